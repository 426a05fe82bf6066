//! The names of shapes: one table for reader and writer.

use crate::terms::Term;

impl Term {
    /// The term of a named shape, in either case: the names of fuzzylite (`Triangle`, `GaussianProduct`,
    /// ...), whose numbers come in the order of [`Term`]'s documentation, and those of jFuzzyLogic (`TRIAN`,
    /// `TRAPE`, `GAUSS`, `GBELL width slope center`, `SIGM slope inflection`, `GAUSS2`, `DSIGM slope
    /// inflection slope inflection`). `Ok(None)` for an unknown name, `Err` for a wrong count.
    pub fn from_keyword(name: &str, numbers: &[f64]) -> Result<Option<Self>, usize> {
        let count = Err(numbers.len());
        macro_rules! shape {
            ($variant:ident) => {
                numbers.try_into().map(|numbers| Some(Self::$variant(numbers))).or(count)
            };
        }
        match name.to_ascii_lowercase().as_str() {
            "triangle" | "trian" => shape!(Triangle),
            "trapezoid" | "trape" => shape!(Trapezoid),
            "ramp" => shape!(Ramp),
            "rectangle" => shape!(Rectangle),
            "gaussian" | "gauss" => shape!(Gaussian),
            "gaussianproduct" | "gauss2" => shape!(GaussianProduct),
            "bell" => shape!(Bell),
            "sigmoid" => shape!(Sigmoid),
            "sigmoiddifference" => shape!(SigmoidDifference),
            "sigmoidproduct" => shape!(SigmoidProduct),
            "sshape" => shape!(SShape),
            "zshape" => shape!(ZShape),
            "pishape" => shape!(PiShape),
            "cosine" => shape!(Cosine),
            "concave" => shape!(Concave),
            "spike" => shape!(Spike),
            "binary" => shape!(Binary),
            "gbell" => match *numbers {
                [width, slope, center] => Ok(Some(Self::Bell([center, width, slope]))),
                _ => count,
            },
            "sigm" => match *numbers {
                [slope, inflection] => Ok(Some(Self::Sigmoid([inflection, slope]))),
                _ => count,
            },
            "dsigm" => match *numbers {
                [rising, left, falling, right] => {
                    Ok(Some(Self::SigmoidDifference([left, rising, falling, right])))
                }
                _ => count,
            },
            "constant" => match *numbers {
                [value] => Ok(Some(Self::Singleton(value))),
                _ => count,
            },
            "linear" if !numbers.is_empty() => Ok(Some(Self::Linear(numbers.to_vec()))),
            "discrete" if !numbers.is_empty() && numbers.len().is_multiple_of(2) => {
                Ok(Some(Self::Points(numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect())))
            }
            "linear" | "discrete" => count,
            _ => Ok(None),
        }
    }

    /// The name of the shape, or `None` for points and single values, which are written without one.
    pub(crate) fn keyword(&self) -> Option<&'static str> {
        Some(match self {
            Self::Triangle(_) => "Triangle",
            Self::Trapezoid(_) => "Trapezoid",
            Self::Ramp(_) => "Ramp",
            Self::Rectangle(_) => "Rectangle",
            Self::Gaussian(_) => "Gaussian",
            Self::GaussianProduct(_) => "GaussianProduct",
            Self::Bell(_) => "Bell",
            Self::Sigmoid(_) => "Sigmoid",
            Self::SigmoidDifference(_) => "SigmoidDifference",
            Self::SigmoidProduct(_) => "SigmoidProduct",
            Self::SShape(_) => "SShape",
            Self::ZShape(_) => "ZShape",
            Self::PiShape(_) => "PiShape",
            Self::Cosine(_) => "Cosine",
            Self::Concave(_) => "Concave",
            Self::Spike(_) => "Spike",
            Self::Binary(_) => "Binary",
            Self::Linear(_) => "Linear",
            Self::Points(_) | Self::Singleton(_) => return None,
        })
    }
}
