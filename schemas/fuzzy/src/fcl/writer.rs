//! From a system back to a text that reads as the same system.

use crate::norms::{Hedge, SNorm, TNorm, keyword_of};
use crate::system::{Condition, Fallback, Input, Method, NamedTerm, Output, Rule, RuleBlock, System};
use crate::terms::Term;
use std::fmt::{Result, Write};

/// The system as an FCL function block.
pub fn write(system: &System) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = system_text(system, &mut text);
    text
}

fn system_text(system: &System, text: &mut String) -> Result {
    writeln!(text, "FUNCTION_BLOCK {}\n\nVAR_INPUT", system.name)?;
    for input in &system.inputs {
        writeln!(text, "  {} : REAL;", input.name)?;
    }
    writeln!(text, "END_VAR\n\nVAR_OUTPUT")?;
    for output in &system.outputs {
        writeln!(text, "  {} : REAL;", output.name)?;
    }
    writeln!(text, "END_VAR")?;
    for input in &system.inputs {
        input_text(input, text)?;
    }
    for output in &system.outputs {
        output_text(output, text)?;
    }
    for block in &system.blocks {
        block_text(system, block, text)?;
    }
    writeln!(text, "\nEND_FUNCTION_BLOCK")
}

fn input_text(input: &Input, text: &mut String) -> Result {
    writeln!(text, "\nFUZZIFY {}", input.name)?;
    range_text(input.range, text)?;
    if input.lock_range {
        writeln!(text, "  LOCK : RANGE;")?;
    }
    terms_text(&input.terms, text)?;
    writeln!(text, "END_FUZZIFY")
}

fn output_text(output: &Output, text: &mut String) -> Result {
    writeln!(text, "\nDEFUZZIFY {}", output.name)?;
    range_text(output.range, text)?;
    if output.lock_range {
        writeln!(text, "  LOCK : RANGE;")?;
    }
    terms_text(&output.terms, text)?;
    writeln!(text, "  METHOD : {};", keyword_of(&Method::KEYWORDS, &output.method))?;
    if let Some(accumulation) = output.accumulation {
        writeln!(text, "  ACCU : {};", keyword_of(&SNorm::KEYWORDS, &accumulation))?;
    }
    match output.default {
        Fallback::Nothing => writeln!(text, "  DEFAULT := nan;")?,
        Fallback::Value(value) => writeln!(text, "  DEFAULT := {value};")?,
        Fallback::Previous => writeln!(text, "  DEFAULT := NC;")?,
        Fallback::PreviousOr(value) => writeln!(text, "  DEFAULT := {value} | NC;")?,
    }
    writeln!(text, "END_DEFUZZIFY")
}

fn range_text(range: Option<(f64, f64)>, text: &mut String) -> Result {
    match range {
        Some((low, high)) => writeln!(text, "  RANGE := ({low} .. {high});"),
        None => Ok(()),
    }
}

fn terms_text(terms: &[NamedTerm], text: &mut String) -> Result {
    for NamedTerm { name, term } in terms {
        write!(text, "  TERM {name} :=")?;
        match term {
            Term::Points(points) => points.iter().try_for_each(|(x, y)| write!(text, " ({x}, {y})"))?,
            term => {
                if let Some(keyword) = term.keyword() {
                    write!(text, " {keyword}")?;
                }
                term.numbers().iter().try_for_each(|number| write!(text, " {number}"))?;
            }
        }
        writeln!(text, ";")?;
    }
    Ok(())
}

fn block_text(system: &System, block: &RuleBlock, text: &mut String) -> Result {
    writeln!(text, "\nRULEBLOCK {}", block.name)?;
    if let Some(and) = block.and {
        writeln!(text, "  AND : {};", keyword_of(&TNorm::KEYWORDS, &and))?;
    }
    if let Some(or) = block.or {
        writeln!(text, "  OR : {};", keyword_of(&SNorm::KEYWORDS, &or))?;
    }
    if let Some(activation) = block.activation {
        writeln!(text, "  ACT : {};", keyword_of(&TNorm::KEYWORDS, &activation))?;
    }
    if let Some(accumulation) = block.accumulation {
        writeln!(text, "  ACCU : {};", keyword_of(&SNorm::KEYWORDS, &accumulation))?;
    }
    for rule in &block.rules {
        rule_text(system, rule, text)?;
    }
    writeln!(text, "END_RULEBLOCK")
}

fn rule_text(system: &System, rule: &Rule, text: &mut String) -> Result {
    write!(text, "  RULE {} : IF ", rule.label)?;
    condition_text(system, &rule.condition, 0, text)?;
    write!(text, " THEN ")?;
    for (index, conclusion) in rule.conclusions.iter().enumerate() {
        let Some(output) = system.outputs.get(conclusion.output) else { continue };
        let Some(named) = output.terms.get(conclusion.term) else { continue };
        let comma = if index == 0 { "" } else { ", " };
        write!(text, "{comma}{} IS {}", output.name, named.name)?;
    }
    if rule.weight < 1.0 {
        write!(text, " WITH {}", rule.weight)?;
    }
    writeln!(text, ";")
}

/// Brackets stand where the part binds less closely than its surroundings: OR 0, AND 1, NOT 2.
fn condition_text(system: &System, condition: &Condition, surroundings: u8, text: &mut String) -> Result {
    let (binding, left, right, word) = match condition {
        Condition::Is { input, hedges, term } => {
            let Some(variable) = system.inputs.get(*input) else { return Ok(()) };
            let Some(named) = variable.terms.get(*term) else { return Ok(()) };
            write!(text, "{} IS ", variable.name)?;
            for hedge in hedges {
                write!(text, "{} ", keyword_of(&Hedge::KEYWORDS, hedge))?;
            }
            return write!(text, "{}", named.name);
        }
        Condition::Not(inner) => {
            write!(text, "NOT ")?;
            return condition_text(system, inner, 2, text);
        }
        Condition::And(left, right) => (1, left, right, "AND"),
        Condition::Or(left, right) => (0, left, right, "OR"),
    };
    let brackets = binding < surroundings;
    if brackets {
        write!(text, "(")?;
    }
    condition_text(system, left, binding, text)?;
    write!(text, " {word} ")?;
    // Equals are read from the left, so an equal on the right needs brackets.
    condition_text(system, right, binding + 1, text)?;
    if brackets {
        write!(text, ")")?;
    }
    Ok(())
}
