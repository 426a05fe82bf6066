//! Rules: `RULE 3 : IF a IS x AND NOT (b IS very y OR c IS NOT z) THEN u IS v, w IS t WITH 0.5;`
//! NOT binds closer than AND, AND closer than OR; equals are read from the left.

use super::lexer::Token;
use super::parser::Parser;
use super::{FclError, FclErrorKind};
use crate::norms::{Hedge, by_keyword};
use crate::system::{Conclusion, Condition, Input, Rule, System};

/// The parts of one condition, and the depth of its brackets.
const MOST_PARTS: usize = 256;

impl Parser {
    /// After the word RULE.
    pub(super) fn rule(&mut self, system: &System) -> Result<Rule, FclError> {
        let label = self.label()?;
        self.symbol(":")?;
        self.keyword("IF", "IF")?;
        let mut left = MOST_PARTS;
        let condition = self.either(system, &mut left)?;
        self.keyword("THEN", "AND, OR or THEN")?;
        let mut conclusions = vec![self.conclusion(system)?];
        while self.eat_symbol(",") || self.eat("AND") {
            conclusions.push(self.conclusion(system)?);
        }
        let mut weight = 1.0;
        if self.eat("WITH") {
            weight = self.number()?;
            if !(0.0..=1.0).contains(&weight) {
                return Err(self.error_before(FclErrorKind::Weight(weight)));
            }
        }
        let closed = self.eat_symbol(";");
        if closed || self.is("RULE") || self.is("END_RULEBLOCK") {
            Ok(Rule { label, condition, conclusions, weight })
        } else {
            Err(self.expected("';', ',', AND, WITH, RULE or END_RULEBLOCK"))
        }
    }

    fn label(&mut self) -> Result<String, FclError> {
        let label = match self.peek() {
            Token::Number(number) => number.to_string(),
            Token::Word(word) => word.clone(),
            _ => return Err(self.expected("the number or name of the rule")),
        };
        self.advance();
        Ok(label)
    }

    fn either(&mut self, system: &System, left: &mut usize) -> Result<Condition, FclError> {
        let mut condition = self.both(system, left)?;
        while self.eat("OR") {
            condition = Condition::Or(Box::new(condition), Box::new(self.both(system, left)?));
        }
        Ok(condition)
    }

    fn both(&mut self, system: &System, left: &mut usize) -> Result<Condition, FclError> {
        let mut condition = self.part(system, left)?;
        while self.eat("AND") {
            condition = Condition::And(Box::new(condition), Box::new(self.part(system, left)?));
        }
        Ok(condition)
    }

    fn part(&mut self, system: &System, left: &mut usize) -> Result<Condition, FclError> {
        *left = left.checked_sub(1).ok_or_else(|| self.error(FclErrorKind::TooLong(MOST_PARTS)))?;
        if self.eat("NOT") {
            return Ok(Condition::Not(Box::new(self.part(system, left)?)));
        }
        if self.eat_symbol("(") {
            let condition = self.either(system, left)?;
            self.symbol(")")?;
            return Ok(condition);
        }
        let name = self.word("an input variable, NOT or '('")?;
        let found = system.inputs.iter().position(|input| input.name == name);
        let unknown = FclErrorKind::UnknownVariable { kind: "input", name };
        let input = found.ok_or_else(|| self.error_before(unknown))?;
        self.keyword("IS", "IS")?;
        let mut hedges = Vec::new();
        let variable = &system.inputs[input];
        loop {
            // Whatever the degree, `any` is 1: it needs no term, and the first stands for all.
            if hedges.last() == Some(&Hedge::Any) && !self.is_term_or_hedge(variable) {
                if variable.terms.is_empty() {
                    return Err(self.error_before(FclErrorKind::AnyOfNothing(variable.name.clone())));
                }
                return Ok(Condition::Is { input, hedges, term: 0 });
            }
            let word = self.word("a term")?;
            // A term's name goes before a hedge's.
            if let Some(term) = variable.terms.iter().position(|named| named.name == word) {
                return Ok(Condition::Is { input, hedges, term });
            }
            let hedge = by_keyword(&Hedge::KEYWORDS, &word);
            let unknown = FclErrorKind::UnknownTerm { variable: variable.name.clone(), name: word };
            hedges.push(hedge.ok_or_else(|| self.error_before(unknown))?);
        }
    }

    fn is_term_or_hedge(&self, variable: &Input) -> bool {
        let Token::Word(word) = self.peek() else { return false };
        variable.terms.iter().any(|named| named.name == *word) || by_keyword(&Hedge::KEYWORDS, word).is_some()
    }

    fn conclusion(&mut self, system: &System) -> Result<Conclusion, FclError> {
        let name = self.word("an output variable")?;
        let found = system.outputs.iter().position(|output| output.name == name);
        let unknown = FclErrorKind::UnknownVariable { kind: "output", name };
        let output = found.ok_or_else(|| self.error_before(unknown))?;
        self.keyword("IS", "IS")?;
        let word = self.word("a term")?;
        let variable = &system.outputs[output];
        let found = variable.terms.iter().position(|named| named.name == word);
        let unknown = FclErrorKind::UnknownTerm { variable: variable.name.clone(), name: word };
        let term = found.ok_or_else(|| self.error_before(unknown))?;
        Ok(Conclusion { output, term })
    }
}
