//! Writing maps: image and YAML appear under their names when both are whole.

use super::{MapError, MapHeader, MapMode, MapProblem};
use crate::{GridError, OccupancyGrid};
use files::Draft;
use image::codecs::pnm::{PnmEncoder, PnmSubtype, SampleEncoding};
use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageError, ImageFormat};
use std::io::{BufWriter, Cursor, Write as _};
use std::path::{Path, PathBuf};

/// The kind of image to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapImage {
    /// Grey, without compression.
    Pgm,
    /// Compressed.
    Png,
}

impl MapImage {
    fn extension(self) -> &'static str {
        match self {
            Self::Pgm => "pgm",
            Self::Png => "png",
        }
    }

    /// The image beside a YAML: of the same name, with the image's extension in the place of the YAML's.
    fn beside(self, yaml: &Path) -> Result<PathBuf, MapProblem> {
        let extension = yaml.extension().map(|extension| extension.to_ascii_lowercase());
        let extension = extension.as_deref().and_then(|extension| extension.to_str()).unwrap_or_default();
        match extension {
            "yaml" | "yml" => Ok(yaml.with_extension(self.extension())),
            "pgm" | "pbm" | "ppm" | "pnm" | "pam" | "png" | "bmp" | "jpg" | "jpeg" | "tif" | "tiff" => {
                Err(MapProblem::NamedLikeImage { proposal: yaml.with_extension("yaml") })
            }
            // What looks like an extension may be a part of the name: `plan.v2` and `plan.v3` are two maps.
            _ => {
                let mut name = yaml.as_os_str().to_owned();
                name.push(".");
                name.push(self.extension());
                Ok(name.into())
            }
        }
    }
}

impl OccupancyGrid {
    /// Whether a map could be saved under that name: see [`OccupancyGrid::save`]. Writes nothing.
    pub fn check_save(yaml: impl AsRef<Path>, image: MapImage) -> Result<(), MapError> {
        let yaml = yaml.as_ref();
        let image = image.beside(yaml).map_err(|problem| MapError { path: yaml.to_owned(), problem })?;
        files::check_place(yaml)?;
        Ok(files::check_place(&image)?)
    }

    /// Writes the map as a YAML file and, beside it, an image of the same name with the extension `pgm` or
    /// `png`. Plain files that were there before are replaced; should anything fail, they stay.
    ///
    /// Trinary maps hold cells of 0, 100 and unknown only, scaled maps need PNG for unknown cells; raw maps
    /// hold everything.
    pub fn save(&self, yaml: impl AsRef<Path>, mode: MapMode, image: MapImage) -> Result<(), MapError> {
        let yaml = yaml.as_ref();
        Self::check_save(yaml, image)?;
        let in_yaml = |problem| MapError { path: yaml.to_owned(), problem };
        let image_path = image.beside(yaml).map_err(in_yaml)?;
        // In trinary maps the usual grey of unknown cells, 205, lies just above this free_thresh. Scaled maps
        // use the whole range between black and white.
        let (occupied_thresh, free_thresh) = match mode {
            MapMode::Trinary => (0.65, 0.196),
            MapMode::Scale | MapMode::Raw => (1.0, 0.0),
        };
        let header = MapHeader {
            image: image_path.file_name().unwrap_or_default().into(),
            resolution_m: self.frame().resolution_m(),
            origin: self.frame().origin(),
            negate: false,
            mode,
            occupied_thresh,
            free_thresh,
        };
        let pixels = self.to_image(mode, image).map_err(in_yaml)?;
        let drawn = Draft::write(&image_path, |file| encode(&pixels, image, file))?;
        let described = Draft::write(yaml, |file| file.write_all(header.to_yaml().as_bytes()))?;
        drawn.put()?;
        Ok(described.put()?)
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

fn encode(
    pixels: &DynamicImage,
    image: MapImage,
    file: &mut BufWriter<&std::fs::File>,
) -> std::io::Result<()> {
    let done = match image {
        MapImage::Pgm => {
            let grey = PnmSubtype::Graymap(SampleEncoding::Binary);
            pixels.write_with_encoder(PnmEncoder::new(file).with_subtype(grey))
        }
        MapImage::Png => {
            let mut packed = Cursor::new(Vec::new());
            pixels
                .write_to(&mut packed, ImageFormat::Png)
                .and_then(|()| Ok(file.write_all(packed.get_ref())?))
        }
    };
    done.map_err(|error| match error {
        ImageError::IoError(error) => error,
        error => std::io::Error::other(error),
    })
}
