//! Reads FLL, the language of fuzzylite, as far as the reference files use it, by rewriting it as FCL.

use fuzzy::{Integration, Options, System, fcl};

/// fuzzylite compares numbers with this tolerance.
pub(crate) const FUZZYLITE_TOLERANCE: f64 = 1e-6;

/// The system of a file, and the options under which fuzzylite runs it.
pub(crate) fn read(text: &str) -> (System, Options) {
    let mut declared = [String::new(), String::new()];
    let mut sections = String::new();
    let mut open = "";
    let mut rules = 0;
    let mut resolution = None;
    let mut name = "";
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let (key, value) = line.split_once(':').expect("a key and a colon in every line");
        let value = value.trim();
        let added = match key {
            "Engine" => {
                name = value;
                String::new()
            }
            "InputVariable" | "OutputVariable" | "RuleBlock" => {
                sections += open;
                let (word, end) = match key {
                    "InputVariable" => ("FUZZIFY", "END_FUZZIFY\n"),
                    "OutputVariable" => ("DEFUZZIFY", "END_DEFUZZIFY\n"),
                    _ => ("RULEBLOCK", "END_RULEBLOCK\n"),
                };
                match key {
                    "InputVariable" => declared[0] += &format!("{value} : REAL;\n"),
                    "OutputVariable" => declared[1] += &format!("{value} : REAL;\n"),
                    _ => {}
                }
                open = end;
                format!("{word} {value}\n")
            }
            "range" => {
                let (low, high) = value.split_once(' ').expect("two ends of a range");
                format!("RANGE := ({low} .. {high});\n")
            }
            "term" => {
                let (name, shape) = value.split_once(' ').expect("a name and a shape");
                format!("TERM {name} := {shape};\n")
            }
            "defuzzifier" => {
                let words: Vec<&str> = value.split(' ').collect();
                match words[..] {
                    ["Centroid", samples] => {
                        resolution = Some(samples.parse().expect("the number of samples"));
                        "METHOD : COG;\n".to_string()
                    }
                    // Each rule counts for itself, whatever the aggregation.
                    ["WeightedAverage", _] => "METHOD : COGS;\nACCU : NSUM;\n".to_string(),
                    _ => panic!("defuzzifier {value}"),
                }
            }
            "aggregation" => assert_operator(value, &["Maximum", "none"]),
            "default" => format!("DEFAULT := {value};\n"),
            "conjunction" if value != "none" => format!("AND : {};\n", operator(value)),
            "disjunction" if value != "none" => format!("OR : {};\n", operator(value)),
            "implication" if value != "none" => format!("ACT : {};\n", operator(value)),
            "rule" => {
                rules += 1;
                format!("RULE {rules} : {value};\n")
            }
            "enabled" => assert_operator(value, &["true"]),
            "lock-range" | "lock-previous" => assert_operator(value, &["false"]),
            "activation" => assert_operator(value, &["General"]),
            "conjunction" | "disjunction" | "implication" => String::new(),
            _ => panic!("unknown key {key}"),
        };
        sections += &added;
    }
    let [inputs, outputs] = declared;
    let text = format!(
        "FUNCTION_BLOCK {name}\nVAR_INPUT {inputs} END_VAR\nVAR_OUTPUT {outputs} END_VAR\n{sections}{open}END_FUNCTION_BLOCK"
    );
    let system = fcl::read(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let integration = resolution.map_or(Integration::Exact, |resolution| Integration::Sampled { resolution });
    (system, Options { integration, comparison_tolerance: FUZZYLITE_TOLERANCE })
}

fn operator(name: &str) -> &'static str {
    match name {
        "Minimum" => "MIN",
        "Maximum" => "MAX",
        "AlgebraicProduct" => "PROD",
        "AlgebraicSum" => "ASUM",
        _ => panic!("operator {name}"),
    }
}

fn assert_operator(value: &str, known: &[&str]) -> String {
    assert!(known.contains(&value), "{value} is not among {known:?}");
    String::new()
}
