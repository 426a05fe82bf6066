//! From tokens to a system: the declarations. Rules are in `rules`.

use super::lexer::{Placed, Token, tokens};
use super::{FclError, FclErrorKind};
use crate::norms::{SNorm, TNorm, by_keyword};
use crate::system::{Fallback, Input, Method, NamedTerm, Output, RuleBlock, System};
use crate::terms::Term;

/// Reads one function block.
pub fn read(text: &str) -> Result<System, FclError> {
    let mut parser = Parser { tokens: tokens(text)?, next: 0 };
    let mut system = System::default();
    parser.keyword("FUNCTION_BLOCK", "FUNCTION_BLOCK")?;
    system.name = parser.optional_name();
    while !parser.eat("END_FUNCTION_BLOCK") {
        parser.section(&mut system)?;
    }
    match parser.peek() {
        Token::End => Ok(system),
        _ => Err(parser.expected("the end of the text (one function block a file)")),
    }
}

/// A variable's name, and its range where that stands beside the declaration.
type Declared = (String, Option<(f64, f64)>);

pub(super) struct Parser {
    tokens: Vec<Placed>,
    next: usize,
}

/// More than these no controller of a robot has, and an engine of these still begins at once.
const MOST_VARIABLES: usize = 100;
const MOST_TERMS: usize = 200;
const MOST_POINTS: usize = 1000;
const MOST_RULES: usize = 10_000;

/// Words that no variable or term may have as a name where a name is optional.
const SECTIONS: [&str; 9] = [
    "VAR_INPUT",
    "VAR_OUTPUT",
    "FUZZIFY",
    "DEFUZZIFY",
    "RULEBLOCK",
    "END_FUNCTION_BLOCK",
    "OPTIONS",
    "END_RULEBLOCK",
    "RULE",
];

impl Parser {
    pub(super) fn peek(&self) -> &Token {
        // The last token is `End`, and `advance` never goes beyond it.
        &self.tokens[self.next].token
    }

    pub(super) fn advance(&mut self) {
        self.next = (self.next + 1).min(self.tokens.len() - 1);
    }

    pub(super) fn error(&self, kind: FclErrorKind) -> FclError {
        FclError { line: self.tokens[self.next].line, column: self.tokens[self.next].column, kind }
    }

    /// An error at the token before.
    pub(super) fn error_before(&self, kind: FclErrorKind) -> FclError {
        let placed = &self.tokens[self.next.saturating_sub(1)];
        FclError { line: placed.line, column: placed.column, kind }
    }

    pub(super) fn expected(&self, expected: &'static str) -> FclError {
        self.error(FclErrorKind::Expected { expected, found: self.peek().to_string() })
    }

    pub(super) fn is(&self, keyword: &str) -> bool {
        matches!(self.peek(), Token::Word(word) if word.eq_ignore_ascii_case(keyword))
    }

    pub(super) fn eat(&mut self, keyword: &str) -> bool {
        let found = self.is(keyword);
        if found {
            self.advance();
        }
        found
    }

    pub(super) fn eat_symbol(&mut self, symbol: &str) -> bool {
        let found = matches!(self.peek(), Token::Symbol(other) if *other == symbol);
        if found {
            self.advance();
        }
        found
    }

    pub(super) fn keyword(&mut self, keyword: &str, expected: &'static str) -> Result<(), FclError> {
        if self.eat(keyword) { Ok(()) } else { Err(self.expected(expected)) }
    }

    pub(super) fn symbol(&mut self, symbol: &'static str) -> Result<(), FclError> {
        if self.eat_symbol(symbol) { Ok(()) } else { Err(self.expected(symbol)) }
    }

    pub(super) fn word(&mut self, expected: &'static str) -> Result<String, FclError> {
        match self.peek() {
            Token::Word(word) => {
                let word = word.clone();
                self.advance();
                Ok(word)
            }
            _ => Err(self.expected(expected)),
        }
    }

    /// A number; `inf` and `nan` are words that count as numbers, with a sign or without.
    pub(super) fn number(&mut self) -> Result<f64, FclError> {
        self.optional_number().ok_or_else(|| self.expected("a number"))
    }

    fn optional_number(&mut self) -> Option<f64> {
        let start = self.next;
        let sign = if matches!(self.peek(), Token::Symbol("-")) { -1.0 } else { 1.0 };
        let has_sign = matches!(self.peek(), Token::Symbol("-" | "+"));
        if has_sign {
            self.advance();
        }
        let value = if let Token::Number(number) = *self.peek() {
            // A sign may stand apart from its number; two signs are an error.
            (!has_sign || !number.is_sign_negative()).then(|| {
                self.advance();
                number
            })
        } else if self.eat("inf") {
            Some(f64::INFINITY)
        } else if self.eat("nan") {
            Some(f64::NAN)
        } else {
            None
        };
        if value.is_none() {
            self.next = start;
        }
        value.map(|value| sign * value)
    }

    fn optional_name(&mut self) -> String {
        match self.peek() {
            Token::Word(word) if !SECTIONS.iter().any(|section| word.eq_ignore_ascii_case(section)) => {
                let name = word.clone();
                self.advance();
                name
            }
            _ => String::new(),
        }
    }

    fn section(&mut self, system: &mut System) -> Result<(), FclError> {
        if self.eat("VAR_INPUT") {
            for (name, range) in self.declarations(system)? {
                system.inputs.push(Input { name, range, ..Input::default() });
            }
        } else if self.eat("VAR_OUTPUT") {
            for (name, range) in self.declarations(system)? {
                system.outputs.push(Output { name, range, ..Output::default() });
            }
        } else if self.eat("FUZZIFY") {
            let name = self.word("the name of an input variable")?;
            let found = system.inputs.iter_mut().find(|input| input.name == name);
            let unknown = FclErrorKind::UnknownVariable { kind: "input", name };
            let input = found.ok_or_else(|| self.error_before(unknown))?;
            if !input.terms.is_empty() {
                return Err(self.error_before(FclErrorKind::Again("FUZZIFY of this variable")));
            }
            self.fuzzify(input)?;
        } else if self.eat("DEFUZZIFY") {
            let name = self.word("the name of an output variable")?;
            let found = system.outputs.iter_mut().find(|output| output.name == name);
            let unknown = FclErrorKind::UnknownVariable { kind: "output", name };
            let output = found.ok_or_else(|| self.error_before(unknown))?;
            if !output.terms.is_empty() {
                return Err(self.error_before(FclErrorKind::Again("DEFUZZIFY of this variable")));
            }
            self.defuzzify(output)?;
        } else if self.eat("RULEBLOCK") {
            let block = self.rule_block(system)?;
            let rules: usize = system.blocks.iter().map(|block| block.rules.len()).sum();
            if rules + block.rules.len() > MOST_RULES || system.blocks.len() >= MOST_RULES {
                return Err(self.error_before(FclErrorKind::TooMany { what: "rules", most: MOST_RULES }));
            }
            system.blocks.push(block);
        } else if self.eat("OPTIONS") {
            // The standard leaves the contents to each tool.
            while !self.eat("END_OPTIONS") {
                if *self.peek() == Token::End {
                    return Err(self.expected("END_OPTIONS"));
                }
                self.advance();
            }
        } else {
            return Err(self.expected(
                "VAR_INPUT, VAR_OUTPUT, FUZZIFY, DEFUZZIFY, RULEBLOCK, OPTIONS or END_FUNCTION_BLOCK",
            ));
        }
        Ok(())
    }

    /// `name : REAL;` until END_VAR, each with the range that may follow it; `a, b : REAL;` declares two.
    fn declarations(&mut self, system: &System) -> Result<Vec<Declared>, FclError> {
        let mut all: Vec<Declared> = Vec::new();
        while !self.eat("END_VAR") {
            let first = all.len();
            loop {
                let name = self.word("the name of a variable or END_VAR")?;
                let known = system.inputs.iter().map(|input| &input.name);
                let known = known.chain(system.outputs.iter().map(|output| &output.name));
                let mut known = known.chain(all.iter().map(|(name, _)| name));
                if known.any(|other| *other == name) {
                    return Err(self.error_before(FclErrorKind::Twice(name)));
                }
                if all.len() >= MOST_VARIABLES {
                    let (what, most) = ("variables", MOST_VARIABLES);
                    return Err(self.error_before(FclErrorKind::TooMany { what, most }));
                }
                all.push((name, None));
                if !self.eat_symbol(",") {
                    break;
                }
            }
            self.symbol(":")?;
            self.keyword("REAL", "REAL")?;
            self.symbol(";")?;
            // As jFuzzyLogic has it; a variable may be called so, too.
            if self.is("RANGE")
                && self.tokens.get(self.next + 1).is_some_and(|next| next.token == Token::Symbol(":="))
            {
                self.advance();
                let range = self.range()?;
                all[first..].iter_mut().for_each(|(_, known)| *known = Some(range));
            }
        }
        Ok(all)
    }

    /// Refuses a second one of what may be said once; after its keyword.
    fn once(&self, seen: &mut Vec<&'static str>, keyword: &'static str) -> Result<(), FclError> {
        if seen.contains(&keyword) {
            return Err(self.error_before(FclErrorKind::Again(keyword)));
        }
        seen.push(keyword);
        Ok(())
    }

    fn fuzzify(&mut self, input: &mut Input) -> Result<(), FclError> {
        let mut seen = if input.range.is_some() { vec!["RANGE"] } else { Vec::new() };
        while !self.eat("END_FUZZIFY") {
            if self.eat("TERM") {
                self.term(&mut input.terms)?;
            } else if self.eat("RANGE") {
                self.once(&mut seen, "RANGE")?;
                input.range = Some(self.range()?);
            } else if self.eat("LOCK") {
                self.once(&mut seen, "LOCK")?;
                self.symbol(":")?;
                self.keyword("RANGE", "RANGE")?;
                self.symbol(";")?;
                input.lock_range = true;
            } else {
                return Err(self.expected("TERM, RANGE, LOCK or END_FUZZIFY"));
            }
        }
        Ok(())
    }

    fn defuzzify(&mut self, output: &mut Output) -> Result<(), FclError> {
        let (mut default, mut hold) = (None, false);
        let mut seen = if output.range.is_some() { vec!["RANGE"] } else { Vec::new() };
        while !self.eat("END_DEFUZZIFY") {
            if self.eat("TERM") {
                self.term(&mut output.terms)?;
            } else if self.eat("RANGE") {
                self.once(&mut seen, "RANGE")?;
                output.range = Some(self.range()?);
            } else if self.eat("METHOD") {
                self.once(&mut seen, "METHOD")?;
                output.method = self.operator(&Method::KEYWORDS, "method of defuzzification")?;
            } else if self.eat("ACCU") {
                self.once(&mut seen, "ACCU")?;
                output.accumulation = Some(self.operator(&SNorm::KEYWORDS, "accumulation")?);
            } else if self.eat("DEFAULT") {
                self.once(&mut seen, "DEFAULT")?;
                self.symbol(":=")?;
                loop {
                    if self.eat("NC") {
                        hold = true;
                    } else {
                        default = Some(self.number()?).filter(|value| !value.is_nan());
                    }
                    if !self.eat_symbol("|") {
                        break;
                    }
                }
                self.symbol(";")?;
            } else if self.eat("LOCK") {
                self.once(&mut seen, "LOCK")?;
                self.symbol(":")?;
                loop {
                    if self.eat("PREVIOUS") {
                        hold = true;
                    } else {
                        self.keyword("RANGE", "PREVIOUS or RANGE")?;
                        output.lock_range = true;
                    }
                    if !self.eat_symbol("|") {
                        break;
                    }
                }
                self.symbol(";")?;
            } else {
                return Err(self.expected("TERM, RANGE, METHOD, ACCU, DEFAULT, LOCK or END_DEFUZZIFY"));
            }
        }
        output.default = match (default, hold) {
            (None, false) => Fallback::Nothing,
            (Some(value), false) => Fallback::Value(value),
            (None, true) => Fallback::Previous,
            (Some(value), true) => Fallback::PreviousOr(value),
        };
        Ok(())
    }

    /// `: WORD ;`
    pub(super) fn operator<T: Copy>(
        &mut self,
        table: &[(&str, T)],
        kind: &'static str,
    ) -> Result<T, FclError> {
        self.symbol(":")?;
        let word = self.word(kind)?;
        let found = by_keyword(table, &word);
        let operator = found.ok_or_else(|| self.error_before(FclErrorKind::UnknownWord { kind, word }))?;
        self.symbol(";")?;
        Ok(operator)
    }

    /// `:= (low .. high);`
    fn range(&mut self) -> Result<(f64, f64), FclError> {
        self.symbol(":=")?;
        let start = self.next;
        self.symbol("(")?;
        let low = self.number()?;
        self.symbol("..")?;
        let high = self.number()?;
        if low >= high || low.is_nan() || high.is_nan() {
            self.next = start;
            return Err(self.error(FclErrorKind::Range(low, high)));
        }
        self.symbol(")")?;
        self.symbol(";")?;
        Ok((low, high))
    }

    /// `name := 1.5;` or `name := (0, 0) (1, 1);` or `name := Shape 0 1 2;`
    fn term(&mut self, terms: &mut Vec<NamedTerm>) -> Result<(), FclError> {
        let name = self.word("the name of a term")?;
        if terms.iter().any(|other| other.name == name) {
            return Err(self.error_before(FclErrorKind::Twice(name)));
        }
        if terms.len() >= MOST_TERMS {
            return Err(
                self.error_before(FclErrorKind::TooMany { what: "terms of a variable", most: MOST_TERMS })
            );
        }
        self.symbol(":=")?;
        let start = self.next;
        let term = if matches!(self.peek(), Token::Symbol("(")) {
            self.points()?
        } else if let Some(value) = self.optional_number() {
            Term::Singleton(value)
        } else {
            let shape = self.word("a number, a point or a shape")?;
            let mut numbers = Vec::new();
            while let Some(number) = self.optional_number() {
                numbers.push(number);
            }
            let made = Term::from_keyword(&shape, &numbers);
            let placed =
                |kind| FclError { line: self.tokens[start].line, column: self.tokens[start].column, kind };
            let made = made.map_err(|count| placed(FclErrorKind::Count { shape: shape.clone(), count }))?;
            made.ok_or_else(|| placed(FclErrorKind::UnknownWord { kind: "shape of a term", word: shape }))?
        };
        if let Err(wrong) = term.check() {
            self.next = start;
            return Err(self.error(wrong.into()));
        }
        self.symbol(";")?;
        terms.push(NamedTerm { name, term });
        Ok(())
    }

    fn points(&mut self) -> Result<Term, FclError> {
        let mut points = Vec::new();
        while self.eat_symbol("(") {
            if points.len() >= MOST_POINTS {
                return Err(
                    self.error_before(FclErrorKind::TooMany { what: "points of a term", most: MOST_POINTS })
                );
            }
            let x = self.number()?;
            self.symbol(",")?;
            let y = self.number()?;
            self.symbol(")")?;
            points.push((x, y));
        }
        Ok(Term::Points(points))
    }

    fn rule_block(&mut self, system: &System) -> Result<RuleBlock, FclError> {
        let mut block = RuleBlock { name: self.block_name(), ..RuleBlock::default() };
        let mut seen = Vec::new();
        while !self.eat("END_RULEBLOCK") {
            if self.eat("AND") {
                self.once(&mut seen, "AND")?;
                block.and = Some(self.operator(&TNorm::KEYWORDS, "AND")?);
            } else if self.eat("OR") {
                self.once(&mut seen, "OR")?;
                block.or = Some(self.operator(&SNorm::KEYWORDS, "OR")?);
            } else if self.eat("ACT") {
                self.once(&mut seen, "ACT")?;
                block.activation = Some(self.operator(&TNorm::KEYWORDS, "activation")?);
            } else if self.eat("ACCU") {
                self.once(&mut seen, "ACCU")?;
                block.accumulation = Some(self.operator(&SNorm::KEYWORDS, "accumulation")?);
            } else if self.eat("RULE") {
                if block.rules.len() >= MOST_RULES {
                    return Err(self.error_before(FclErrorKind::TooMany { what: "rules", most: MOST_RULES }));
                }
                block.rules.push(self.rule(system)?);
            } else {
                return Err(self.expected("AND, OR, ACT, ACCU, RULE or END_RULEBLOCK"));
            }
        }
        Ok(block)
    }

    /// A block's name may be left out: then the next word is an operator's and a colon follows it.
    fn block_name(&mut self) -> String {
        let colon = self.tokens.get(self.next + 1).is_some_and(|placed| placed.token == Token::Symbol(":"));
        if colon { String::new() } else { self.optional_name() }
    }
}
