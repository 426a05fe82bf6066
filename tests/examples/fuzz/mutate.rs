//! Damages files.

use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

/// Files grow to this size, and seldom to the other, which is more than most limits.
const BYTES_MAX: usize = 256 << 10;
const BYTES_MAX_SELDOM: usize = 24 << 20;
/// Numbers that parsers stumble over.
const NUMBERS: &[&str] = &[
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "1e-9",
    "0.05",
    ".5",
    "+.5",
    "5.",
    "1e9",
    "1e99999",
    "nan",
    "NaN",
    "-nan",
    "inf",
    "-inf",
    "Infinity",
    "1.#INF",
    "0x10",
    "0b1",
    "0o7",
    "1_000",
    "1,5",
    "١",
    "00",
    "1e",
    "--1",
    "3.141592653589793",
    "33554432",
    "16777214",
    "16777216",
    "100000000",
    "99999999999999999999999999999999999999999",
];
/// What opens something that must be closed, and what is often forgotten.
const OPENERS: &[&str] = &[
    "[", "{", "(", "[[", "- ", "a.", "(*", "\"", "'", "\"\"\"", "/*", "<", "&a [", "? ", "!!x ", "((",
    "[a]\n", "- - ",
];
/// Characters that are not what they look like, or no characters.
const CHARACTERS: &[&[u8]] = &[
    b"\0",
    b"\r",
    b"\r\n",
    b"\t",
    b"\x0b",
    b"\x1b[31m",
    b"\x7f",
    b"\xff",
    b"\xc0\x80",
    b"\xed\xa0\x80",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\xf0\x9f\xa4\x96",
    b"\xe2\x80\xae",
    b"\xc2\xa0",
    b"#",
    b";",
    b":",
    b",",
    b"=",
    b"|",
    b">",
    b"*",
    b"%",
    b"@",
    b"`",
    b"\\",
    b"\n\n",
    b"\n---\n",
    b"\n...\n",
];

/// Where a kind's damaged files come from.
#[derive(Debug)]
pub(crate) struct Mutator {
    /// Valid files.
    pub(crate) seeds: Vec<Vec<u8>>,
    /// Words of the language, which get into the wrong places.
    pub(crate) words: &'static [&'static str],
    /// Whether numbers lie in files as bytes.
    pub(crate) is_binary: bool,
}

/// The source of all chance of one file.
pub(crate) fn chance(seed: u64, number: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03),
    )
}

impl Mutator {
    /// The damaged file of this number, and which seed it was.
    pub(crate) fn file(&self, chance: &mut Pcg64Mcg) -> (Vec<u8>, usize) {
        let seed = chance.random_range(0..self.seeds.len());
        let mut bytes = self.seeds[seed].clone();
        // Many files have one fault, some have many.
        let faults = if chance.random_bool(0.5) { 1 } else { chance.random_range(1..12) };
        for _ in 0..faults {
            let most = if chance.random_bool(0.003) { BYTES_MAX_SELDOM } else { BYTES_MAX };
            self.damage(&mut bytes, most, chance);
        }
        (bytes, seed)
    }

    fn damage(&self, bytes: &mut Vec<u8>, most: usize, chance: &mut Pcg64Mcg) {
        let kinds = if self.is_binary { 0..12 } else { 0..10 };
        match chance.random_range(kinds) {
            0 => flip(bytes, chance),
            1 => {
                let character = pick(CHARACTERS, chance);
                let at = place(bytes, chance);
                insert(bytes, at..at, character);
            }
            2 => {
                let range = stretch(bytes, chance);
                bytes.drain(range);
            }
            3 => repeat(bytes, most, chance),
            4 => self.splice(bytes, chance),
            5 if chance.random_bool(0.3) => bytes.truncate(place(bytes, chance)),
            5 => swap_lines(bytes, chance),
            6 => {
                let at = place(bytes, chance);
                let word = if self.words.is_empty() { "x" } else { pick(self.words, chance) };
                let end = if chance.random_bool(0.5) { at } else { word_end(bytes, at) };
                insert(bytes, at..end, word.as_bytes());
            }
            7 | 8 => number(bytes, chance),
            9 => {
                let times = log_uniform(most / 4, chance);
                let opened = pick(OPENERS, chance).repeat(times);
                let at = place(bytes, chance);
                insert(bytes, at..at, &opened.as_bytes()[..opened.len().min(most)]);
            }
            _ => raw_number(bytes, chance),
        }
    }

    /// A piece of another file.
    fn splice(&self, bytes: &mut Vec<u8>, chance: &mut Pcg64Mcg) {
        let other = pick(&self.seeds, chance);
        let piece = other[stretch(other, chance)].to_vec();
        let at = place(bytes, chance);
        let range = if chance.random_bool(0.5) { at..at } else { stretch(bytes, chance) };
        insert(bytes, range, &piece);
    }
}

fn pick<'a, T>(of: &'a [T], chance: &mut Pcg64Mcg) -> &'a T {
    &of[chance.random_range(0..of.len())]
}

fn place(bytes: &[u8], chance: &mut Pcg64Mcg) -> usize {
    chance.random_range(0..=bytes.len())
}

/// A part of the file: a few bytes, or a line or more.
fn stretch(bytes: &[u8], chance: &mut Pcg64Mcg) -> Range<usize> {
    let begin = place(bytes, chance);
    if chance.random_bool(0.5) {
        let begin = bytes[..begin].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let mut end = begin;
        for _ in 0..log_uniform(30, chance) {
            end = bytes[end..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |at| end + at + 1);
        }
        return begin..end;
    }
    begin..(begin + log_uniform(bytes.len().max(1), chance)).min(bytes.len())
}

/// From 1 to so many, small ones as likely as large ones.
fn log_uniform(most: usize, chance: &mut Pcg64Mcg) -> usize {
    let most = most.max(1) as f64;
    most.powf(chance.random::<f64>()) as usize
}

fn insert(bytes: &mut Vec<u8>, range: Range<usize>, with: &[u8]) {
    bytes.splice(range, with.iter().copied());
}

fn flip(bytes: &mut [u8], chance: &mut Pcg64Mcg) {
    for _ in 0..log_uniform(8, chance) {
        if bytes.is_empty() {
            return;
        }
        let at = chance.random_range(0..bytes.len());
        bytes[at] = if chance.random_bool(0.5) {
            chance.random()
        } else {
            bytes[at] ^ (1 << chance.random_range(0..8))
        };
    }
}

fn repeat(bytes: &mut Vec<u8>, most: usize, chance: &mut Pcg64Mcg) {
    let range = stretch(bytes, chance);
    if range.is_empty() {
        return;
    }
    let times = log_uniform(most / range.len(), chance);
    let piece = bytes[range.clone()].repeat(times);
    insert(bytes, range.end..range.end, &piece);
}

fn swap_lines(bytes: &mut Vec<u8>, chance: &mut Pcg64Mcg) {
    let mut lines: Vec<&[u8]> = bytes.split(|byte| *byte == b'\n').collect();
    let (one, other) = (chance.random_range(0..lines.len()), chance.random_range(0..lines.len()));
    lines.swap(one, other);
    *bytes = lines.join(&b'\n');
}

fn is_of_number(byte: u8) -> bool {
    byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+')
}

fn word_end(bytes: &[u8], at: usize) -> usize {
    let is_of_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    at + bytes[at..].iter().take_while(|byte| is_of_word(byte)).count()
}

/// Another number in the place of one, or one made longer.
fn number(bytes: &mut Vec<u8>, chance: &mut Pcg64Mcg) {
    let from = place(bytes, chance);
    let Some(digit) = bytes[from..].iter().position(u8::is_ascii_digit).map(|at| from + at) else { return };
    let begin = digit - bytes[..digit].iter().rev().take_while(|byte| is_of_number(**byte)).count();
    let end = digit + bytes[digit..].iter().take_while(|byte| is_of_number(**byte)).count();
    if chance.random_bool(0.1) {
        let digits = vec![b'9'; log_uniform(10_000, chance)];
        insert(bytes, digit..digit, &digits);
    } else {
        let with = *pick(NUMBERS, chance);
        insert(bytes, begin..end, with.as_bytes());
    }
}

/// A number of one to eight bytes that is large, small or near to a power of two.
fn raw_number(bytes: &mut [u8], chance: &mut Pcg64Mcg) {
    let width = [1, 2, 4, 8][chance.random_range(0..4)];
    if bytes.len() < width {
        return;
    }
    let value = match chance.random_range(0..5) {
        0 => 0,
        1 => u64::MAX,
        2 => 1_u64 << chance.random_range(0..64),
        3 => (1_u64 << chance.random_range(0..64)).wrapping_sub(1),
        _ => chance.next_u64(),
    };
    let at = chance.random_range(0..=bytes.len() - width);
    let raw = if chance.random_bool(0.5) { value.to_le_bytes() } else { value.to_be_bytes() };
    let raw = if chance.random_bool(0.5) { &raw[..width] } else { &raw[8 - width..] };
    bytes[at..at + width].copy_from_slice(raw);
}
