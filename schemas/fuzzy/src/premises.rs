//! From input values to the activation of every rule, compiled: memberships lie in one flat array of slots,
//! terms with straight flanks are computed side by side without a branch, and a rule that is a plain
//! conjunction is a row of slots.

use super::norms::{Hedge, SNorm, TNorm, larger, smaller};
use super::options::EngineError;
use super::system::{Condition, RuleBlock, System};
use super::terms::Term;
use std::ops::Range;

/// The first slot is always 1, the neutral element of every AND: rows shorter than their group are filled
/// with it.
const TRUE: u16 = 0;

/// Beyond this an input counts as this: an infinite distance stays infinite enough, and no sum becomes NaN.
const FARTHEST: f64 = 1e150;

#[derive(Debug, Clone)]
pub(crate) struct Premises {
    inputs: Vec<InputPlan>,
    flanks: Vec<Flanks>,
    curves: Vec<Curve>,
    bent: Vec<Bent>,
    slots: Vec<f64>,
    /// The slot of each input's each term.
    addresses: Vec<Vec<u16>>,
    rows: Vec<Rows>,
    programs: Vec<Program>,
    stack: Vec<f64>,
    activations: Vec<f64>,
}

#[derive(Debug, Clone)]
struct InputPlan {
    lock: Option<(f64, f64)>,
    flanks: Range<usize>,
}

/// A term with degree `min(1, rise_base + rise (x - rise_x), fall_base + fall (fall_x - x))`, not below zero.
#[derive(Debug, Clone, Copy)]
struct Flanks {
    rise_x: f64,
    rise: f64,
    rise_base: f64,
    fall_x: f64,
    fall: f64,
    fall_base: f64,
}

#[derive(Debug, Clone)]
struct Curve {
    input: usize,
    slot: u16,
    term: Term,
    /// Corners to which a value within the comparison tolerance is moved.
    corners: Vec<f64>,
}

/// A slot that hedges derive from another.
#[derive(Debug, Clone, PartialEq)]
struct Bent {
    from: u16,
    slot: u16,
    /// In the order of their application.
    hedges: Vec<Hedge>,
}

/// Rules that are conjunctions of up to `width` slots.
#[derive(Debug, Clone)]
struct Rows {
    and: TNorm,
    slots: RowSlots,
    rules: Vec<u32>,
    weights: Vec<f64>,
}

#[derive(Debug, Clone)]
enum RowSlots {
    One(Vec<[u16; 1]>),
    Two(Vec<[u16; 2]>),
    Three(Vec<[u16; 3]>),
    Four(Vec<[u16; 4]>),
    Eight(Vec<[u16; 8]>),
}

/// A rule of any other form, in postfix order.
#[derive(Debug, Clone)]
struct Program {
    rule: u32,
    weight: f64,
    and: TNorm,
    or: SNorm,
    operations: Vec<Operation>,
}

#[derive(Debug, Clone, Copy)]
enum Operation {
    Slot(u16),
    And,
    Or,
    Not,
}

impl Premises {
    pub(crate) fn new(system: &System, comparison_tolerance: f64) -> Result<Self, EngineError> {
        let mut plan = Self {
            inputs: Vec::new(),
            flanks: Vec::new(),
            curves: Vec::new(),
            bent: Vec::new(),
            slots: vec![1.0],
            addresses: system.inputs.iter().map(|input| vec![TRUE; input.terms.len()]).collect(),
            rows: Vec::new(),
            programs: Vec::new(),
            stack: Vec::new(),
            activations: vec![0.0; system.blocks.iter().map(|block| block.rules.len()).sum()],
        };
        let tolerant = comparison_tolerance > 0.0;
        for (index, input) in system.inputs.iter().enumerate() {
            let first = plan.flanks.len();
            for (term, named) in input.terms.iter().enumerate() {
                if let Some(flanks) = Flanks::of(&named.term).filter(|_| !tolerant) {
                    plan.flanks.push(flanks);
                    plan.addresses[index][term] = plan.new_slot()?;
                }
            }
            let lock = input.range.filter(|_| input.lock_range);
            plan.inputs.push(InputPlan { lock, flanks: first..plan.flanks.len() });
        }
        for (input, variable) in system.inputs.iter().enumerate() {
            for (term, named) in variable.terms.iter().enumerate() {
                if plan.addresses[input][term] == TRUE {
                    let slot = plan.new_slot()?;
                    plan.addresses[input][term] = slot;
                    let corners = if tolerant { named.term.corners() } else { None };
                    let corners = corners.unwrap_or_default().into_iter().map(|corner| corner.0).collect();
                    plan.curves.push(Curve { input, slot, term: named.term.clone(), corners });
                }
            }
        }
        let mut first_rule = 0;
        for block in &system.blocks {
            plan.add_block(block, first_rule)?;
            first_rule += block.rules.len();
        }
        Ok(plan)
    }

    pub(crate) fn activations(&self) -> &[f64] {
        &self.activations
    }

    pub(crate) fn membership(&self, input: usize, term: usize) -> Option<f64> {
        let slot = *self.addresses.get(input)?.get(term)?;
        Some(self.slots[usize::from(slot)])
    }

    /// Computes every rule's activation. False, and all activations zero, if a value is missing or not a
    /// number.
    pub(crate) fn evaluate(&mut self, values: &[f64], comparison_tolerance: f64) -> bool {
        if values.len() < self.inputs.len() || values.iter().any(|value| value.is_nan()) {
            self.slots[1..].fill(0.0);
            self.activations.fill(0.0);
            return false;
        }
        for (plan, &value) in self.inputs.iter().zip(values) {
            let x = locked(value, plan.lock);
            let slots = &mut self.slots[plan.flanks.start + 1..plan.flanks.end + 1];
            for (slot, flanks) in slots.iter_mut().zip(&self.flanks[plan.flanks.clone()]) {
                *slot = flanks.membership(x);
            }
        }
        for curve in &self.curves {
            let x = locked(values[curve.input], self.inputs[curve.input].lock);
            let near = curve.corners.iter().find(|corner| (x - **corner).abs() < comparison_tolerance);
            self.slots[usize::from(curve.slot)] = curve.term.membership(near.copied().unwrap_or(x));
        }
        for bent in &self.bent {
            let degree = self.slots[usize::from(bent.from)];
            self.slots[usize::from(bent.slot)] =
                bent.hedges.iter().fold(degree, |degree, hedge| hedge.apply(degree));
        }
        for rows in &self.rows {
            rows.evaluate(&self.slots, &mut self.activations);
        }
        for program in &self.programs {
            let degree = program.evaluate(&self.slots, &mut self.stack);
            self.activations[program.rule as usize] = program.weight * degree;
        }
        true
    }

    fn new_slot(&mut self) -> Result<u16, EngineError> {
        let slot = u16::try_from(self.slots.len()).map_err(|_| EngineError::TooManyTerms)?;
        self.slots.push(0.0);
        Ok(slot)
    }

    fn add_block(&mut self, block: &RuleBlock, first_rule: usize) -> Result<(), EngineError> {
        let mut conjunctions: Vec<(u32, f64, Vec<u16>)> = Vec::new();
        for (index, rule) in block.rules.iter().enumerate() {
            let number = u32::try_from(first_rule + index).map_err(|_| EngineError::TooManyTerms)?;
            if !(0.0..=1.0).contains(&rule.weight) {
                return Err(EngineError::Weight { rule: rule.label.clone(), weight: rule.weight });
            }
            let mut operations = Vec::new();
            self.flatten(&rule.condition, &mut operations)?;
            let slots: Vec<u16> = operations.iter().filter_map(Operation::slot).collect();
            let plain =
                operations.iter().all(|operation| matches!(operation, Operation::Slot(_) | Operation::And));
            if plain && slots.len() <= 8 {
                conjunctions.push((number, rule.weight, slots));
            } else {
                let (weight, and, or) = (rule.weight, block.and(), block.or());
                self.stack.reserve(operations.len());
                self.programs.push(Program { rule: number, weight, and, or, operations });
            }
        }
        for (low, high) in [(1, 1), (2, 2), (3, 3), (4, 4), (5, 8)] {
            let of_width = |row: &&(u32, f64, Vec<u16>)| (low..=high).contains(&row.2.len());
            let chosen: Vec<_> = conjunctions.iter().filter(of_width).collect();
            if chosen.is_empty() {
                continue;
            }
            let slots = match high {
                1 => RowSlots::One(chosen.iter().map(|row| padded(&row.2)).collect()),
                2 => RowSlots::Two(chosen.iter().map(|row| padded(&row.2)).collect()),
                3 => RowSlots::Three(chosen.iter().map(|row| padded(&row.2)).collect()),
                4 => RowSlots::Four(chosen.iter().map(|row| padded(&row.2)).collect()),
                _ => RowSlots::Eight(chosen.iter().map(|row| padded(&row.2)).collect()),
            };
            let rules = chosen.iter().map(|row| row.0).collect();
            let weights = chosen.iter().map(|row| row.1).collect();
            self.rows.push(Rows { and: block.and(), slots, rules, weights });
        }
        Ok(())
    }

    fn flatten(&mut self, condition: &Condition, into: &mut Vec<Operation>) -> Result<(), EngineError> {
        match condition {
            Condition::Is { input, hedges, term } => {
                let slot = self.slot_of(*input, *term, hedges)?;
                into.push(Operation::Slot(slot));
            }
            Condition::And(left, right) => {
                self.flatten(left, into)?;
                self.flatten(right, into)?;
                into.push(Operation::And);
            }
            Condition::Or(left, right) => {
                self.flatten(left, into)?;
                self.flatten(right, into)?;
                into.push(Operation::Or);
            }
            Condition::Not(inner) => {
                if let Condition::Is { input, hedges, term } = inner.as_ref() {
                    let negated: Vec<Hedge> =
                        [Hedge::Not].into_iter().chain(hedges.iter().copied()).collect();
                    into.push(Operation::Slot(self.slot_of(*input, *term, &negated)?));
                } else {
                    self.flatten(inner, into)?;
                    into.push(Operation::Not);
                }
            }
        }
        Ok(())
    }

    fn slot_of(&mut self, input: usize, term: usize, hedges: &[Hedge]) -> Result<u16, EngineError> {
        let known = self.addresses.get(input).and_then(|terms| terms.get(term)).copied();
        let from = known.ok_or(EngineError::NoSuchTerm { variable: input, term })?;
        if hedges.is_empty() {
            return Ok(from);
        }
        let hedges: Vec<Hedge> = hedges.iter().rev().copied().collect();
        if let Some(bent) = self.bent.iter().find(|bent| bent.from == from && bent.hedges == hedges) {
            return Ok(bent.slot);
        }
        let slot = self.new_slot()?;
        self.bent.push(Bent { from, slot, hedges });
        Ok(slot)
    }
}

impl Flanks {
    /// Terms made of at most one rising flank from 0 to 1 and then at most one falling flank back, neither
    /// upright.
    fn of(term: &Term) -> Option<Self> {
        let corners = term.corners()?;
        let (mut rise, mut fall) = (None, None);
        for pair in corners.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            match (level(y0)?, level(y1)?) {
                (false, true) if x1 > x0 && rise.is_none() && fall.is_none() => rise = Some((x0, x1)),
                (true, false) if x1 > x0 && fall.is_none() => fall = Some((x0, x1)),
                (before, after) if before == after => {}
                _ => return None,
            }
        }
        let single = corners.len() < 2 || (rise.is_none() && fall.is_none());
        let (rise_x, rise, rise_base) = rise.map_or((0.0, 0.0, 1.0), |(x0, x1)| (x0, 1.0 / (x1 - x0), 0.0));
        let (fall_x, fall, fall_base) = fall.map_or((0.0, 0.0, 1.0), |(x0, x1)| (x1, 1.0 / (x1 - x0), 0.0));
        (!single).then_some(Self { rise_x, rise, rise_base, fall_x, fall, fall_base })
    }

    #[inline(always)]
    fn membership(&self, x: f64) -> f64 {
        let rise = self.rise_base + (x - self.rise_x) * self.rise;
        let fall = self.fall_base + (self.fall_x - x) * self.fall;
        larger(smaller(smaller(rise, fall), 1.0), 0.0)
    }
}

impl Operation {
    fn slot(&self) -> Option<u16> {
        if let Self::Slot(slot) = self { Some(*slot) } else { None }
    }
}

impl Rows {
    fn evaluate(&self, slots: &[f64], activations: &mut [f64]) {
        match &self.slots {
            RowSlots::One(rows) => self.conjoin(rows, slots, activations),
            RowSlots::Two(rows) => self.conjoin(rows, slots, activations),
            RowSlots::Three(rows) => self.conjoin(rows, slots, activations),
            RowSlots::Four(rows) => self.conjoin(rows, slots, activations),
            RowSlots::Eight(rows) => self.conjoin(rows, slots, activations),
        }
    }

    #[inline(always)]
    fn conjoin<const W: usize>(&self, rows: &[[u16; W]], slots: &[f64], activations: &mut [f64]) {
        match self.and {
            TNorm::Minimum => self.fold(rows, slots, activations, smaller),
            TNorm::Product => self.fold(rows, slots, activations, |a, b| a * b),
            other => self.fold(rows, slots, activations, |a, b| other.apply(a, b)),
        }
    }

    #[inline(always)]
    fn fold<const W: usize>(
        &self,
        rows: &[[u16; W]],
        slots: &[f64],
        activations: &mut [f64],
        and: impl Fn(f64, f64) -> f64,
    ) {
        for ((row, rule), weight) in rows.iter().zip(&self.rules).zip(&self.weights) {
            let mut degree = slots[usize::from(row[0])];
            for slot in &row[1..] {
                degree = and(degree, slots[usize::from(*slot)]);
            }
            activations[*rule as usize] = weight * degree;
        }
    }
}

impl Program {
    fn evaluate(&self, slots: &[f64], stack: &mut Vec<f64>) -> f64 {
        stack.clear();
        let mut top = 0.0;
        for operation in &self.operations {
            match operation {
                Operation::Slot(slot) => {
                    stack.push(top);
                    top = slots[usize::from(*slot)];
                }
                Operation::And => top = self.and.apply(stack.pop().unwrap_or(0.0), top),
                Operation::Or => top = self.or.apply(stack.pop().unwrap_or(0.0), top),
                Operation::Not => top = 1.0 - top,
            }
        }
        top
    }
}

fn locked(value: f64, lock: Option<(f64, f64)>) -> f64 {
    let (low, high) = lock.unwrap_or((-FARTHEST, FARTHEST));
    larger(smaller(value, high), low)
}

fn level(y: f64) -> Option<bool> {
    if y <= 0.0 {
        Some(false)
    } else if y >= 1.0 {
        Some(true)
    } else {
        None
    }
}

fn padded<const W: usize>(slots: &[u16]) -> [u16; W] {
    std::array::from_fn(|index| slots.get(index).copied().unwrap_or(TRUE))
}
