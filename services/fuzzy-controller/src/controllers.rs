//! The three fuzzy controllers, each an FCL file that an experimenter edits.

use crate::params::{Params, ParamsError};
use files::FileError;
use fuzzy::{Engine, EngineError, Options, System, fcl};
use std::path::Path;

/// A rule file of a thousand rules has 100 KiB.
const RULES_MAX: u64 = 1 << 20;

const MOTION: &str = include_str!("../fcl/motion.fcl");
const AVOIDANCE: &str = include_str!("../fcl/avoidance.fcl");
const ROTATION: &str = include_str!("../fcl/rotation.fcl");

/// The wheel speeds that a controller concludes.
const OUTPUTS: [&str; 2] = ["left_mps", "right_mps"];

/// Why the controller cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The parameters.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The world file.
    #[error("world: {0}")]
    World(#[from] geometry::WorldError),
    /// A rule file that cannot be read from the disk.
    #[error(transparent)]
    Unreadable(#[from] FileError),
    /// A rule file that is no FCL.
    #[error("{file}: {source}")]
    Rules {
        /// The file.
        file: String,
        /// What is wrong, with line and column.
        source: fcl::FclError,
    },
    /// A rule file whose system makes no sense.
    #[error("{file}: {source}")]
    System {
        /// The file.
        file: String,
        /// What is wrong.
        source: EngineError,
    },
    /// A rule file with other variables than the controller has.
    #[error("{file}: the {kind} variables must be {expected:?}, but are {found:?}")]
    Variables {
        /// The file.
        file: String,
        /// "input" or "output".
        kind: &'static str,
        /// What the controller has, in any order.
        expected: Vec<&'static str>,
        /// What the file declares.
        found: Vec<String>,
    },
}

/// A wheel pair's speeds, left and right.
pub(crate) type Wheels = [f64; 2];

/// One controller: an engine, and where its variables stand.
#[derive(Debug, Clone)]
pub struct Controller<const N: usize> {
    engine: Engine,
    /// For each of the engine's inputs, which of the step's values it takes.
    order: [usize; N],
    left: usize,
    right: usize,
}

impl<const N: usize> Controller<N> {
    fn new(
        path: &str,
        built_in: &str,
        built_in_name: &str,
        inputs: [&'static str; N],
    ) -> Result<Self, SetupError> {
        let (file, text) = if path.is_empty() {
            (built_in_name.to_string(), built_in.to_string())
        } else {
            (path.to_string(), files::read_text(Path::new(path), RULES_MAX)?)
        };
        let system = fcl::read(&text).map_err(|source| SetupError::Rules { file: file.clone(), source })?;
        let (order, places) = match (input_order(&system, inputs), output_places(&system)) {
            (Some(order), Some(places)) => (order, places),
            (None, _) => {
                let found = system.inputs.iter().map(|input| input.name.clone()).collect();
                return Err(SetupError::Variables { file, kind: "input", expected: inputs.to_vec(), found });
            }
            (_, None) => {
                let found = system.outputs.iter().map(|output| output.name.clone()).collect();
                return Err(SetupError::Variables {
                    file,
                    kind: "output",
                    expected: OUTPUTS.to_vec(),
                    found,
                });
            }
        };
        let engine = Engine::new(&system, Options::default());
        let engine = engine.map_err(|source| SetupError::System { file, source })?;
        Ok(Self { engine, order, left: places[0], right: places[1] })
    }

    /// The wheel speeds for the inputs in the order of the controller's definition; NaN if the rules are
    /// silent.
    pub(crate) fn step(&mut self, values: [f64; N]) -> Wheels {
        let ordered = self.order.map(|index| values[index]);
        let outputs = self.engine.step(&ordered);
        [outputs[self.left], outputs[self.right]]
    }

    /// The engine: its last activations, memberships and outputs.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }
}

fn input_order<const N: usize>(system: &System, names: [&str; N]) -> Option<[usize; N]> {
    let found: Option<Vec<usize>> =
        system.inputs.iter().map(|input| names.iter().position(|name| *name == input.name)).collect();
    found?.try_into().ok()
}

fn output_places(system: &System) -> Option<[usize; 2]> {
    let place = |name| system.outputs.iter().position(|output| output.name == name);
    Some([place(OUTPUTS[0])?, place(OUTPUTS[1])?]).filter(|_| system.outputs.len() == 2)
}

/// The paper's three controllers (ASN-140).
#[derive(Debug, Clone)]
pub struct Controllers {
    /// MM: `distance_m`, `angle_deg`.
    pub motion: Controller<2>,
    /// OAM: `left_m`, `front_m`, `right_m`.
    pub avoidance: Controller<3>,
    /// CSM: `angle_deg`.
    pub rotation: Controller<1>,
}

impl Controllers {
    /// The built-in rules, or those of the files that the parameters name.
    pub(crate) fn new(params: &Params) -> Result<Self, SetupError> {
        let motion =
            Controller::new(&params.motion_rules, MOTION, "fcl/motion.fcl", ["distance_m", "angle_deg"])?;
        let avoidance = Controller::new(
            &params.avoidance_rules,
            AVOIDANCE,
            "fcl/avoidance.fcl",
            ["left_m", "front_m", "right_m"],
        )?;
        let rotation = Controller::new(&params.rotation_rules, ROTATION, "fcl/rotation.fcl", ["angle_deg"])?;
        Ok(Self { motion, avoidance, rotation })
    }
}
