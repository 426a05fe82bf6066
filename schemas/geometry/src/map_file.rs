//! Maps as files: the YAML and image pair of the ROS map servers.
//!
//! The YAML names the image and says what its pixels mean: `image` (its path, relative to the YAML),
//! `resolution` (metres a pixel), `origin` ([x, y, yaw] of the outer corner of the lower left pixel),
//! `negate` (0 or 1: dark is free), `mode` (`trinary`, `scale`, `raw`; trinary when left out),
//! `occupied_thresh`, `free_thresh`. The image's first row is the map's last. Other keys and whatever stands
//! below them are ignored, as map servers do.
//!
//! Map servers differ in what they make of colours and transparency. This reader does as `map_server` of ROS
//! 1 and as nav2 up to Iron: colours are averaged, in trinary maps the opacity along with them. (nav2 since
//! Jazzy weighs colours by luminance, and takes what is not fully opaque for unknown in trinary maps too.)
//! Indexed images have the colours of their palette, and 16 bits count in full, as in nav2.

mod image_file;
mod save;
mod yaml;

pub use save::MapImage;

use crate::{GridError, GridFrame, Occupancy, OccupancyGrid, Pose2};
use files::{FileError, FileProblem};
use std::path::{Path, PathBuf};
use yaml::{Entry, Value};

/// A YAML of a map has a few hundred bytes; this leaves room for the notes of a lifetime.
const YAML_MAX: u64 = 256 << 10;

/// Metres a pixel: below, a robot's map has more cells than any computer's memory; above, a robot fits
/// between two of them.
const RESOLUTION_M: std::ops::RangeInclusive<f64> = 0.001..=10.0;

/// No place on earth lies farther from a map's origin, in metres.
const FARTHEST_M: f64 = 1e8;

/// What a pixel means. With p = 1 - brightness (brightness itself if negated), both from 0 to 1:
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MapMode {
    /// p above `occupied_thresh` is occupied, below `free_thresh` free, and between unknown. The opacity of
    /// an image that has one is averaged into the brightness as a fourth colour.
    #[default]
    Trinary,
    /// As `Trinary` outside of the thresholds; between them the probability rises in proportion. A pixel that
    /// is not fully opaque is unknown.
    Scale,
    /// The pixel's brightness, 0 to 255, is the per cent; what is above 100 is unknown. Neither `negate` nor
    /// opacity counts.
    Raw,
}

/// A pixel, in whole steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pixel {
    /// Red, green and blue, from 0 to `full`; of a grey image three times the same.
    pub colours: [u32; 3],
    /// From 0, transparent, to `full`; `None` in an image without transparency.
    pub opacity: Option<u32>,
    /// The brightest step: 255 or 65 535.
    pub full: u32,
}

/// Everything that the YAML of a map says.
#[derive(Debug, Clone, PartialEq)]
pub struct MapHeader {
    /// The image, relative to the YAML's folder or absolute.
    pub image: PathBuf,
    /// Metres a pixel.
    pub resolution_m: f64,
    /// The outer corner of the lower left pixel, and the direction of the rows.
    pub origin: Pose2,
    /// Whether bright means occupied.
    pub negate: bool,
    /// What pixels mean.
    pub mode: MapMode,
    /// Above it a cell is occupied, 0 to 1.
    pub occupied_thresh: f64,
    /// Below it a cell is free, 0 to 1, not above `occupied_thresh`.
    pub free_thresh: f64,
}

/// A map file that cannot be used. The text names the file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", files::shown(path))]
pub struct MapError {
    /// The file that is wrong: the YAML or the image.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: MapProblem,
}

/// What can be wrong with a map file.
#[derive(Debug, thiserror::Error)]
pub enum MapProblem {
    /// It cannot be read or written.
    #[error(transparent)]
    File(#[from] FileProblem),
    /// The image that a YAML names cannot be read.
    #[error("{problem}; {} names it, and the path counts from the folder of that file{hint}", yaml.display())]
    Named {
        /// The YAML.
        yaml: PathBuf,
        /// Why the image cannot be read.
        problem: FileProblem,
        /// What may be meant by it.
        hint: &'static str,
    },
    /// It is not the YAML that maps are written in.
    #[error("line {line}: {problem}")]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// In words.
        problem: String,
    },
    /// A key is missing.
    #[error("the key `{key}` is missing")]
    Missing {
        /// The key.
        key: &'static str,
    },
    /// A value is not what its key wants.
    #[error("line {line}: {key}: {value:?} is not {wanted}")]
    BadValue {
        /// Counted from 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// As written in the file.
        value: String,
        /// In words.
        wanted: &'static str,
    },
    /// The thresholds are in the wrong order.
    #[error("free_thresh {free_thresh} is above occupied_thresh {occupied_thresh}")]
    ThresholdsCross {
        /// Below it a cell is free.
        free_thresh: f64,
        /// Above it a cell is occupied.
        occupied_thresh: f64,
    },
    /// The image is broken, or of a kind other than PGM, PBM, PPM, PAM, PNG or BMP.
    #[error("it is no image that can be read (PGM, PBM, PPM, PAM, PNG or BMP): {0}")]
    Image(#[from] image::ImageError),
    /// More in the file than its pixels: where they begin is in doubt.
    #[error(
        "{surplus} more than {width} x {height} pixels; is the head of the file not as it should be, such as one that ends in CR LF?"
    )]
    Surplus {
        /// How much there is too much, in words.
        surplus: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The name under which a map is to be saved is that of an image.
    #[error("a map is saved under the name of its YAML, such as {}; the image is written beside it", proposal.display())]
    NamedLikeImage {
        /// A name that would do.
        proposal: PathBuf,
    },
    /// The image's size or the YAML's numbers make no grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The mode cannot hold the cell's value.
    #[error("the cell in column {column}, row {row} is {value:?}, which {wanted}")]
    Inexpressible {
        /// Counted from 0.
        column: u32,
        /// Counted from 0.
        row: u32,
        /// The cell.
        value: Occupancy,
        /// In words.
        wanted: &'static str,
    },
}

impl MapHeader {
    /// Reads the text of a YAML file.
    pub fn parse(text: &str) -> Result<Self, MapProblem> {
        let entries = yaml::parse(text).map_err(|error| MapProblem::Syntax {
            line: error.line,
            problem: files::in_brief(&error.problem),
        })?;
        let find = |key: &'static str| entries.iter().find(|entry| entry.key == key);
        let need = |key: &'static str| find(key).ok_or(MapProblem::Missing { key });
        let mode = find("mode").map_or(Ok(MapMode::default()), mode)?;
        let wanted = "a positive number of metres, from 0.001 to 10";
        let resolution_m = number("resolution", need("resolution")?, wanted, |m| RESOLUTION_M.contains(&m))?;
        let threshold = |key| number(key, need(key)?, "a number from 0 to 1", |t| (0.0..=1.0).contains(&t));
        // Raw maps have no use for thresholds; otherwise there is no value that suits every map server.
        let [occupied_thresh, free_thresh] = match mode {
            MapMode::Raw if find("occupied_thresh").is_none() || find("free_thresh").is_none() => [1.0, 0.0],
            _ => [threshold("occupied_thresh")?, threshold("free_thresh")?],
        };
        if free_thresh > occupied_thresh {
            return Err(MapProblem::ThresholdsCross { free_thresh, occupied_thresh });
        }
        let image = need("image")?;
        let Value::Text(path) = &image.value else { return Err(bad("image", image, "the path of an image")) };
        if path.is_empty() {
            return Err(bad("image", image, "the path of an image"));
        }
        Ok(Self {
            image: path.into(),
            resolution_m,
            origin: origin(need("origin")?)?,
            negate: find("negate").map_or(Ok(false), flag)?,
            mode,
            occupied_thresh,
            free_thresh,
        })
    }

    /// The text of a YAML file that [`MapHeader::parse`] reads back.
    pub fn to_yaml(&self) -> String {
        let Self { image, resolution_m, origin, negate, mode, occupied_thresh, free_thresh } = self;
        let image = yaml::quoted(&image.to_string_lossy());
        let Pose2 { x_m, y_m, heading_rad } = origin;
        let (mode, negate) = (mode.name(), u8::from(*negate));
        format!(
            "image: {image}\nmode: {mode}\nresolution: {resolution_m:?}\norigin: [{x_m:?}, {y_m:?}, {heading_rad:?}]\n\
             negate: {negate}\noccupied_thresh: {occupied_thresh:?}\nfree_thresh: {free_thresh:?}\n"
        )
    }

    /// What a pixel means. Thresholds are met exactly: fractions are formed of whole numbers.
    pub fn occupancy(&self, pixel: Pixel) -> Occupancy {
        let sum = |values: &[u32]| values.iter().map(|&value| u64::from(value)).sum::<u64>();
        let (mut bright, mut parts) = (sum(&pixel.colours), 3);
        if let (MapMode::Trinary, Some(opacity)) = (self.mode, pixel.opacity) {
            bright += u64::from(opacity);
            parts = 4;
        }
        let all = parts * u64::from(pixel.full);
        let share = |part: u64| part as f64 / all as f64;
        if self.mode == MapMode::Raw {
            return Occupancy::from_ros((share(bright) * 255.0).round().min(101.0) as i8);
        }
        let occupied = share(if self.negate { bright } else { all.saturating_sub(bright) });
        if self.mode == MapMode::Scale && pixel.opacity.is_some_and(|opacity| opacity < pixel.full) {
            Occupancy::UNKNOWN
        } else if occupied > self.occupied_thresh {
            Occupancy::OCCUPIED
        } else if occupied < self.free_thresh {
            Occupancy::FREE
        } else if self.mode == MapMode::Trinary {
            Occupancy::UNKNOWN
        } else {
            let between = self.occupied_thresh - self.free_thresh;
            // Equal thresholds leave one value between, which is as free as it is occupied.
            Occupancy::from_probability(if between > 0.0 {
                (occupied - self.free_thresh) / between
            } else {
                0.5
            })
        }
    }
}

impl MapMode {
    fn name(self) -> &'static str {
        match self {
            Self::Trinary => "trinary",
            Self::Scale => "scale",
            Self::Raw => "raw",
        }
    }
}

fn bad(key: &'static str, entry: &Entry, wanted: &'static str) -> MapProblem {
    let value = match &entry.value {
        Value::Text(text) => text.clone(),
        Value::List(items) => format!("[{}]", items.join(", ")),
        Value::Other => "a table or a longer list".to_owned(),
    };
    MapProblem::BadValue { line: entry.line, key, value: files::in_brief(&value), wanted }
}

fn number(
    key: &'static str,
    entry: &Entry,
    wanted: &'static str,
    good: impl Fn(f64) -> bool,
) -> Result<f64, MapProblem> {
    let Value::Text(text) = &entry.value else { return Err(bad(key, entry, wanted)) };
    let value = text.parse().ok().filter(|value: &f64| value.is_finite() && good(*value));
    value.ok_or_else(|| bad(key, entry, wanted))
}

fn mode(entry: &Entry) -> Result<MapMode, MapProblem> {
    let Value::Text(text) = &entry.value else { return Err(bad("mode", entry, "trinary, scale or raw")) };
    let modes = [MapMode::Trinary, MapMode::Scale, MapMode::Raw];
    let named = modes.into_iter().find(|mode| mode.name().eq_ignore_ascii_case(text));
    named.ok_or_else(|| bad("mode", entry, "trinary, scale or raw"))
}

fn flag(entry: &Entry) -> Result<bool, MapProblem> {
    let Value::Text(text) = &entry.value else { return Err(bad("negate", entry, "0 or 1")) };
    match text.to_ascii_lowercase().as_str() {
        "0" | "false" | "no" | "off" => Ok(false),
        "1" | "true" | "yes" | "on" => Ok(true),
        _ => Err(bad("negate", entry, "0 or 1")),
    }
}

fn origin(entry: &Entry) -> Result<Pose2, MapProblem> {
    let wanted = "a list of three finite numbers: x, y (up to 1e8 m), yaw";
    let near = |number: f64| number.abs() <= FARTHEST_M;
    let Value::List(items) = &entry.value else { return Err(bad("origin", entry, wanted)) };
    let numbers: Vec<f64> = items.iter().filter_map(|item| item.parse().ok()).collect();
    match (numbers.as_slice(), items.len()) {
        (&[x_m, y_m, yaw], 3) if near(x_m) && near(y_m) && near(yaw) => Ok(Pose2::new(x_m, y_m, yaw)),
        _ => Err(bad("origin", entry, wanted)),
    }
}

impl OccupancyGrid {
    /// Reads the map that a YAML file describes, with its image.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, MapError> {
        let (header, mut image) = open(path.as_ref())?;
        image_file::cells(&header, &mut image.reader)
            .map_err(|problem| MapError { path: image.path, problem })
    }

    /// How large the map is that a YAML file describes, and where it lies. Reads no pixels: what is wrong
    /// with the YAML, and an image that is not there, too large or of an unknown kind, is found as by
    /// [`OccupancyGrid::load`].
    pub fn look(path: impl AsRef<Path>) -> Result<GridFrame, MapError> {
        let (header, mut image) = open(path.as_ref())?;
        image_file::frame(&header, &mut image.reader)
            .map_err(|problem| MapError { path: image.path, problem })
    }
}

struct Image {
    path: PathBuf,
    reader: std::io::BufReader<std::fs::File>,
}

fn open(yaml: &Path) -> Result<(MapHeader, Image), MapError> {
    let text = files::read_text(yaml, YAML_MAX)?;
    let header = MapHeader::parse(&text).map_err(|problem| MapError { path: yaml.to_owned(), problem })?;
    let path = yaml.parent().unwrap_or(Path::new("")).join(&header.image);
    let named = header.image.to_string_lossy();
    let hint = if named.starts_with('~') {
        "; `~` is no home there: write the whole path"
    } else if named.contains("://") {
        "; only paths are understood, no addresses"
    } else {
        ""
    };
    match files::open(&path, image_file::FILE_MAX) {
        Ok(file) => Ok((header, Image { path, reader: std::io::BufReader::with_capacity(1 << 16, file) })),
        Err(FileError { path, problem }) => {
            Err(MapError { path, problem: MapProblem::Named { yaml: yaml.to_owned(), problem, hint } })
        }
    }
}

impl From<FileError> for MapError {
    fn from(error: FileError) -> Self {
        Self { path: error.path, problem: error.problem.into() }
    }
}
