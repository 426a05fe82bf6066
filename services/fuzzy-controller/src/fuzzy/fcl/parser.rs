//! From tokens to a system: the declarations. Rules are in `rules`.

use super::super::norms::{SNorm, TNorm, by_keyword};
use super::super::system::{Fallback, Input, Method, NamedTerm, Output, RuleBlock, System};
use super::super::terms::Term;
use super::lexer::{Placed, Token, tokens};
use super::{FclError, FclErrorKind};

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

pub(super) struct Parser {
    tokens: Vec<Placed>,
    next: usize,
}

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
        let sign = match self.peek() {
            Token::Number(number) => {
                let number = *number;
                self.advance();
                return Some(number);
            }
            Token::Symbol("-") => -1.0,
            _ => 1.0,
        };
        let start = self.next;
        if matches!(self.peek(), Token::Symbol("-" | "+")) {
            self.advance();
        }
        let value = if self.eat("inf") {
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
            for name in self.declarations(system)? {
                system.inputs.push(Input { name, ..Input::default() });
            }
        } else if self.eat("VAR_OUTPUT") {
            for name in self.declarations(system)? {
                system.outputs.push(Output { name, ..Output::default() });
            }
        } else if self.eat("FUZZIFY") {
            let name = self.word("the name of an input variable")?;
            let found = system.inputs.iter_mut().find(|input| input.name == name);
            let unknown = FclErrorKind::UnknownVariable { kind: "input", name };
            let input = found.ok_or_else(|| self.error_before(unknown))?;
            self.fuzzify(input)?;
        } else if self.eat("DEFUZZIFY") {
            let name = self.word("the name of an output variable")?;
            let found = system.outputs.iter_mut().find(|output| output.name == name);
            let unknown = FclErrorKind::UnknownVariable { kind: "output", name };
            let output = found.ok_or_else(|| self.error_before(unknown))?;
            self.defuzzify(output)?;
        } else if self.eat("RULEBLOCK") {
            let block = self.rule_block(system)?;
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

    /// `name : REAL;` until END_VAR; `a, b : REAL;` declares two.
    fn declarations(&mut self, system: &System) -> Result<Vec<String>, FclError> {
        let mut names: Vec<String> = Vec::new();
        while !self.eat("END_VAR") {
            loop {
                let name = self.word("the name of a variable or END_VAR")?;
                let known = system.inputs.iter().map(|input| &input.name);
                let mut known = known.chain(system.outputs.iter().map(|output| &output.name)).chain(&names);
                if known.any(|other| *other == name) {
                    return Err(self.error_before(FclErrorKind::Twice(name)));
                }
                names.push(name);
                if !self.eat_symbol(",") {
                    break;
                }
            }
            self.symbol(":")?;
            self.keyword("REAL", "REAL")?;
            self.symbol(";")?;
        }
        Ok(names)
    }

    fn fuzzify(&mut self, input: &mut Input) -> Result<(), FclError> {
        while !self.eat("END_FUZZIFY") {
            if self.eat("TERM") {
                self.term(&mut input.terms)?;
            } else if self.eat("RANGE") {
                input.range = Some(self.range()?);
            } else if self.eat("LOCK") {
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
        while !self.eat("END_DEFUZZIFY") {
            if self.eat("TERM") {
                self.term(&mut output.terms)?;
            } else if self.eat("RANGE") {
                output.range = Some(self.range()?);
            } else if self.eat("METHOD") {
                output.method = self.operator(&Method::KEYWORDS, "method of defuzzification")?;
            } else if self.eat("ACCU") {
                output.accumulation = Some(self.operator(&SNorm::KEYWORDS, "accumulation")?);
            } else if self.eat("DEFAULT") {
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
        while !self.eat("END_RULEBLOCK") {
            if self.eat("AND") {
                block.and = Some(self.operator(&TNorm::KEYWORDS, "AND")?);
            } else if self.eat("OR") {
                block.or = Some(self.operator(&SNorm::KEYWORDS, "OR")?);
            } else if self.eat("ACT") {
                block.activation = Some(self.operator(&TNorm::KEYWORDS, "activation")?);
            } else if self.eat("ACCU") {
                block.accumulation = Some(self.operator(&SNorm::KEYWORDS, "accumulation")?);
            } else if self.eat("RULE") {
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
