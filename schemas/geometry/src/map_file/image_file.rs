//! The image of a map: how large it may be, and what its pixels mean.

use super::{MapHeader, MapProblem, Pixel};
use crate::grid::MOST_CELLS;
use crate::{GridFrame, Occupancy, OccupancyGrid};
use files::bytes_in_words;
use image::codecs::pnm::{PnmDecoder, SampleEncoding};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};

/// The largest grid at four bytes a pixel, which is more than any map needs that is not written as text.
pub(super) const FILE_MAX: u64 = 4 * MOST_CELLS;

/// Unpacked pixels at once: the largest grid in eight bytes a pixel, which is the most that an image has.
const PIXELS_MAX: u64 = 8 * MOST_CELLS;

/// The cells of a map, from the image that lies in `file`.
pub(super) fn cells(header: &MapHeader, file: &mut BufReader<File>) -> Result<OccupancyGrid, MapProblem> {
    let frame = frame(header, file)?;
    check_surplus(file)?;
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let reader = ImageReader::new(file).with_guessed_format().map_err(io)?;
    let mut decoder = reader.into_decoder()?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(PIXELS_MAX);
    decoder.set_limits(limits)?;
    let image = DynamicImage::from_decoder(decoder)?;
    let cells = match &image {
        // Images of one byte a pixel, which nearly all maps are, have 256 meanings.
        DynamicImage::ImageLuma8(grey) => {
            let meanings: Vec<_> = (0..=255).map(|value| header.occupancy(grey_pixel(value, None))).collect();
            let rows = grey.as_raw().chunks_exact(frame.width() as usize).rev();
            rows.flat_map(|row| row.iter().map(|&value| meanings[usize::from(value)])).collect()
        }
        DynamicImage::ImageLumaA8(image) => {
            weigh(&frame, image.as_raw(), |&[v, a]| header.occupancy(grey_pixel(v, Some(a))))
        }
        DynamicImage::ImageRgb8(image) => {
            weigh(&frame, image.as_raw(), |pixel| header.occupancy(colour_pixel(pixel, None, 255)))
        }
        DynamicImage::ImageRgba8(image) => weigh(&frame, image.as_raw(), |&[r, g, b, a]| {
            header.occupancy(colour_pixel(&[r, g, b], Some(a), 255))
        }),
        DynamicImage::ImageLuma16(image) => {
            weigh(&frame, image.as_raw(), |&[v]| header.occupancy(colour_pixel(&[v; 3], None, 65_535)))
        }
        DynamicImage::ImageLumaA16(image) => {
            weigh(&frame, image.as_raw(), |&[v, a]| header.occupancy(colour_pixel(&[v; 3], Some(a), 65_535)))
        }
        DynamicImage::ImageRgb16(image) => {
            weigh(&frame, image.as_raw(), |pixel| header.occupancy(colour_pixel(pixel, None, 65_535)))
        }
        // Whatever else there may be some day has no more in it.
        image => weigh(&frame, image.to_rgba16().as_raw(), |&[r, g, b, a]| {
            header.occupancy(colour_pixel(&[r, g, b], Some(a), 65_535))
        }),
    };
    Ok(OccupancyGrid::new(frame, cells)?)
}

/// Where the cells of a map lie, from the head of the image that lies in `file`.
pub(super) fn frame(header: &MapHeader, file: &mut BufReader<File>) -> Result<GridFrame, MapProblem> {
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let decoder = ImageReader::new(file).with_guessed_format().map_err(io)?.into_decoder()?;
    let (width, height) = decoder.dimensions();
    Ok(GridFrame::new(width, height, header.resolution_m, header.origin)?)
}

fn grey_pixel(value: u8, opacity: Option<u8>) -> Pixel {
    colour_pixel(&[value; 3], opacity, 255)
}

fn colour_pixel<S: Copy + Into<u32>>(colours: &[S; 3], opacity: Option<S>, full: u32) -> Pixel {
    Pixel { colours: colours.map(Into::into), opacity: opacity.map(Into::into), full }
}

/// The meaning of every pixel of `N` samples, from the map's first row, which is the image's last.
fn weigh<S, const N: usize>(
    frame: &GridFrame,
    samples: &[S],
    meaning: impl Fn(&[S; N]) -> Occupancy,
) -> Vec<Occupancy> {
    let mut cells = Vec::with_capacity(frame.len());
    for row in samples.chunks_exact(frame.width() as usize * N).rev() {
        cells.extend(row.as_chunks::<N>().0.iter().map(&meaning));
    }
    cells
}

/// Refuses a PNM file that holds more than its pixels: then nothing says where they begin. A line's end after
/// the last is no surplus.
fn check_surplus(file: &mut BufReader<File>) -> Result<(), MapProblem> {
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let is_pnm = image::guess_format(file.fill_buf().map_err(io)?).is_ok_and(|kind| kind == ImageFormat::Pnm);
    if !is_pnm {
        return Ok(());
    }
    let decoder = PnmDecoder::new(&mut *file)?;
    let (width, height) = decoder.dimensions();
    let (subtype, wide) = (decoder.subtype(), decoder.header().maximal_sample() > 255);
    let depth = u64::from(decoder.original_color_type().channel_count());
    let (file, head) = decoder.into_inner();
    let samples = u64::from(width) * u64::from(height) * depth;
    let surplus = match subtype.sample_encoding() {
        SampleEncoding::Ascii => {
            let is_bits = head.as_bitmap().is_some();
            let numbers = count_numbers(file, is_bits).map_err(io)?.saturating_sub(samples);
            (numbers > 0).then(|| format!("{numbers} numbers"))
        }
        SampleEncoding::Binary => {
            let bytes = if head.as_bitmap().is_some() {
                u64::from(width.div_ceil(8)) * u64::from(height)
            } else {
                samples * if wide { 2 } else { 1 }
            };
            file.seek_relative(i64::try_from(bytes).unwrap_or(i64::MAX)).map_err(io)?;
            let mut rest = Vec::new();
            let more =
                file.stream_position().and_then(|at| Ok(file.get_ref().metadata()?.len().saturating_sub(at)));
            file.take(3).read_to_end(&mut rest).map_err(io)?;
            let more = more.map_err(io)?;
            let is_line_end = matches!(rest.as_slice(), b"\n" | b"\r\n");
            (more > 0 && !is_line_end).then(|| match more {
                1 => "1 byte".to_owned(),
                more => bytes_in_words(more),
            })
        }
    };
    surplus.map_or(Ok(()), |surplus| Err(MapProblem::Surplus { surplus, width, height }))
}

/// How many numbers of a PNM file in text are left, without comments; bits need no blanks between them.
fn count_numbers(file: &mut impl BufRead, is_bits: bool) -> std::io::Result<u64> {
    let (mut count, mut in_number, mut in_comment) = (0, false, false);
    loop {
        let block = file.fill_buf()?;
        if block.is_empty() {
            return Ok(count);
        }
        for &byte in block {
            in_comment = (in_comment || byte == b'#') && byte != b'\n';
            let is_part = !in_comment && !byte.is_ascii_whitespace();
            count += u64::from(is_part && (is_bits || !in_number));
            in_number = is_part;
        }
        let length = block.len();
        file.consume(length);
    }
}

fn io(error: std::io::Error) -> MapProblem {
    MapProblem::Image(ImageError::IoError(error))
}
