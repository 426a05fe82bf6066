//! Maps as files: the YAML and image pair of the ROS map servers.
//!
//! The YAML names the image and says what its pixels mean: `image` (its path, relative to the YAML), `resolution` (metres a
//! pixel), `origin` ([x, y, yaw] of the outer corner of the lower left pixel), `negate` (0 or 1: dark is free), `mode`
//! (`trinary`, `scale`, `raw`; trinary when left out), `occupied_thresh`, `free_thresh`. The image's first row is the map's
//! last. Other keys are ignored, as map servers do.

mod yaml;

use crate::{GridError, GridFrame, MOST_CELLS, Occupancy, OccupancyGrid, Pose2};
use image::codecs::pnm::{PnmEncoder, PnmSubtype, SampleEncoding};
use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageDecoder, ImageFormat, ImageReader};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use yaml::{Entry, Value};

/// What a pixel means. With p = 1 - brightness (brightness itself if negated), both from 0 to 1:
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MapMode {
    /// p above `occupied_thresh` is occupied, below `free_thresh` free, and between unknown.
    #[default]
    Trinary,
    /// The same outside of the thresholds; between them the probability rises in proportion. A pixel that is not fully
    /// opaque is unknown.
    Scale,
    /// The pixel's value, 0 to 255, is the per cent; what is above 100 is unknown.
    Raw,
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
#[error("{}: {problem}", path.display())]
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
    #[error("{0}")]
    Io(#[from] std::io::Error),
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
    /// The image is broken, or of a kind other than PGM, PBM, PPM, PAM or PNG.
    #[error("it is no image that can be read: {0}")]
    Image(#[from] image::ImageError),
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
        let entries = yaml::parse(text)
            .map_err(|error| MapProblem::Syntax { line: error.line, problem: error.problem })?;
        let find = |key: &'static str| entries.iter().find(|entry| entry.key == key);
        let need = |key: &'static str| find(key).ok_or(MapProblem::Missing { key });
        let mode = find("mode").map_or(Ok(MapMode::default()), mode)?;
        let resolution_m =
            number("resolution", need("resolution")?, "a positive number of metres", |m| m > 0.0)?;
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

    /// What a pixel means: `brightness` and `opacity` from 0 to 1.
    pub fn occupancy(&self, brightness: f64, opacity: f64) -> Occupancy {
        if self.mode == MapMode::Raw {
            return Occupancy::from_ros((brightness * 255.0).round().min(101.0) as i8);
        }
        let occupied = if self.negate { brightness } else { 1.0 - brightness };
        if opacity < 1.0 {
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
    };
    MapProblem::BadValue { line: entry.line, key, value, wanted }
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
    let wanted = "a list of three finite numbers: x, y, yaw";
    let Value::List(items) = &entry.value else { return Err(bad("origin", entry, wanted)) };
    let numbers: Vec<f64> = items.iter().filter_map(|item| item.parse().ok()).collect();
    match (numbers.as_slice(), items.len()) {
        (&[x_m, y_m, yaw], 3) if x_m.is_finite() && y_m.is_finite() && yaw.is_finite() => {
            Ok(Pose2::new(x_m, y_m, yaw))
        }
        _ => Err(bad("origin", entry, wanted)),
    }
}

impl OccupancyGrid {
    /// Reads the map that a YAML file describes, with its image.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, MapError> {
        let yaml = path.as_ref();
        let text = std::fs::read_to_string(yaml).map_err(at(yaml))?;
        let header = MapHeader::parse(&text).map_err(at(yaml))?;
        let image = yaml.parent().unwrap_or(Path::new("")).join(&header.image);
        let pixels = read_image(&image).map_err(at(&image))?;
        Self::from_image(&header, &pixels).map_err(at(&image))
    }

    fn from_image(header: &MapHeader, image: &DynamicImage) -> Result<Self, MapProblem> {
        let (width, height) = (image.width(), image.height());
        let frame = GridFrame::new(width, height, header.resolution_m, header.origin)?;
        // Images of one byte a pixel, which nearly all maps are, need no other copy.
        let mut cells = Vec::with_capacity(frame.len());
        if let DynamicImage::ImageLuma8(grey) = image {
            let meanings: Vec<_> = (0..=255).map(|v| header.occupancy(f64::from(v) / 255.0, 1.0)).collect();
            for row in grey.as_raw().chunks_exact(width as usize).rev() {
                cells.extend(row.iter().map(|&value| meanings[usize::from(value)]));
            }
        } else {
            let full = f64::from(u16::MAX);
            let grey = image.to_luma_alpha16();
            for row in grey.as_raw().chunks_exact(2 * width as usize).rev() {
                cells.extend(
                    row.chunks_exact(2).map(|pixel| {
                        header.occupancy(f64::from(pixel[0]) / full, f64::from(pixel[1]) / full)
                    }),
                );
            }
        }
        Ok(Self::new(frame, cells)?)
    }

    /// Writes the map as a YAML file and, beside it, an image of the same name with the extension `pgm` or `png`. What was
    /// there before is replaced.
    ///
    /// Trinary maps hold cells of 0, 100 and unknown only, scaled maps need PNG for unknown cells; raw maps hold everything.
    pub fn save(&self, yaml: impl AsRef<Path>, mode: MapMode, image: MapImage) -> Result<(), MapError> {
        let yaml = yaml.as_ref();
        let extension = match image {
            MapImage::Pgm => "pgm",
            MapImage::Png => "png",
        };
        let image_path = yaml.with_extension(extension);
        let name = image_path.file_name().unwrap_or_default();
        // In trinary maps the usual grey of unknown cells, 205, lies just above this free_thresh. Scaled maps use the whole
        // range between black and white.
        let (occupied_thresh, free_thresh) = match mode {
            MapMode::Trinary => (0.65, 0.196),
            MapMode::Scale | MapMode::Raw => (1.0, 0.0),
        };
        let header = MapHeader {
            image: name.into(),
            resolution_m: self.frame().resolution_m(),
            origin: self.frame().origin(),
            negate: false,
            mode,
            occupied_thresh,
            free_thresh,
        };
        let pixels = self.to_image(mode, image).map_err(at(yaml))?;
        let write = || -> Result<(), MapProblem> {
            let mut file = BufWriter::new(File::create(&image_path)?);
            match image {
                MapImage::Pgm => {
                    let grey = PnmSubtype::Graymap(SampleEncoding::Binary);
                    pixels.write_with_encoder(PnmEncoder::new(&mut file).with_subtype(grey))?;
                }
                MapImage::Png => pixels.write_to(&mut file, ImageFormat::Png)?,
            }
            Ok(std::io::Write::flush(&mut file)?)
        };
        write().map_err(at(&image_path))?;
        std::fs::write(yaml, header.to_yaml()).map_err(at(yaml))
    }

    fn to_image(&self, mode: MapMode, image: MapImage) -> Result<DynamicImage, MapProblem> {
        let (width, height) = (self.frame().width(), self.frame().height());
        let with_alpha = mode == MapMode::Scale && image == MapImage::Png;
        let mut bytes = Vec::with_capacity(self.frame().len() * if with_alpha { 2 } else { 1 });
        for row in (0..height).rev() {
            let begin = row as usize * width as usize;
            for (column, &value) in (0..width).zip(&self.as_slice()[begin..]) {
                let refuse = |wanted| Err(MapProblem::Inexpressible { column, row, value, wanted });
                match (mode, value.percent()) {
                    (MapMode::Trinary, Some(0)) => bytes.push(254),
                    (MapMode::Trinary, Some(100)) => bytes.push(0),
                    (MapMode::Trinary, None) => bytes.push(205),
                    (MapMode::Trinary, Some(_)) => return refuse("a trinary map cannot hold"),
                    (MapMode::Scale, None) if with_alpha => bytes.extend([0, 0]),
                    (MapMode::Scale, None) => return refuse("a scaled map holds as PNG only"),
                    (MapMode::Scale, Some(percent)) => {
                        // Brightness in 255 steps tells all 101 values apart.
                        bytes.push((255.0 - 2.55 * f64::from(percent)).round() as u8);
                        bytes.extend(with_alpha.then_some(255));
                    }
                    (MapMode::Raw, percent) => bytes.push(percent.unwrap_or(255)),
                }
            }
        }
        let pixels = if with_alpha {
            GrayAlphaImage::from_raw(width, height, bytes).map(DynamicImage::from)
        } else {
            GrayImage::from_raw(width, height, bytes).map(DynamicImage::from)
        };
        pixels.ok_or(MapProblem::Grid(GridError::BadSize { width, height }))
    }
}

/// Says which file a problem is in.
fn at<P: Into<MapProblem>>(path: &Path) -> impl Fn(P) -> MapError {
    move |problem| MapError { path: path.to_owned(), problem: problem.into() }
}

fn read_image(path: &Path) -> Result<DynamicImage, MapProblem> {
    let reader = ImageReader::open(path)?.with_guessed_format()?;
    let decoder = reader.into_decoder()?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MOST_CELLS {
        return Err(GridError::BadSize { width, height }.into());
    }
    Ok(DynamicImage::from_decoder(decoder)?)
}

/// The kind of image to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapImage {
    /// Grey, without compression.
    Pgm,
    /// Compressed.
    Png,
}
