//! The list of all samplers, from which everything that goes by sampler is generated: [`Sampler`], the
//! fields and keys of [`Parameters`], the keys of the window, and the numbers of what shaders see.
//! `build.rs` reads it too.
//!
//! [`Sampler`]: crate::sampler::Sampler
//! [`Parameters`]: crate::sampler::Parameters

/// Calls the macro `$then` with every sampler, simplest first. A line has the name in Rust and on the command
/// line, the key in the window and the tag in `sample.comp`; one of a room, which has parameters and a file
/// `shader.rs`, room, entry point and parameters.
macro_rules! registry {
    ($then:ident) => {
        $then! {
            basic {
                /// Uniform over the hemisphere.
                Uniform "uniform" "1" = SAMPLER_UNIFORM;
                /// Proportional to the cosine.
                Cosine "cosine" "2" = SAMPLER_COSINE;
                /// The BRDF's own sampling.
                Brdf "brdf" "3" = SAMPLER_BRDF;
                /// Proportional to the luminance of the environment map.
                Env "env" "4" = SAMPLER_ENV;
                /// `brdf` and `env` in turns with the one-sample balance heuristic (Veach & Guibas 1995).
                Mis "mis" "5" = SAMPLER_MIS;
                /// Resampled importance sampling over candidates of `mis` (Burke et al. 2005; Talbot et al.
                /// 2005).
                Ris "ris" "6" = SAMPLER_RIS;
            }
            rooms {
                /// Lobes of the product of environment and BRDF (Tsai et al. 2008).
                Product "product" "7" = product ProductRoom ProductParameters;
                /// `product`, with less weight on lobes near blocked directions (Wu & Shih 2009).
                Visibility "visibility" "8" = visibility VisibilityRoom VisibilityParameters;
                /// Regions of the environment by visibility learned in cells of the scene, across pixels and
                /// passes.
                Guided "guided" "9" = guided GuidedRoom GuidedParameters;
                /// `mis` with directions through the portals of the scene (Ureña et al. 2013).
                Portal "portal" "o" = portal PortalRoom PortalParameters;
                /// Product of environment and BRDF on a wavelet basis (Clarberg & Akenine-Möller 2008).
                Haar "haar" "u" = haar HaarRoom HaarParameters;
                /// Rays among candidates, with recorded visibility as control variate (Clarberg &
                /// Akenine-Möller 2008).
                ControlVariates "control-variates" "v" =
                    control_variates ControlVariatesRoom ControlVariatesParameters;
                /// `mis` with tiles of the environment by visibility learned in camera space (Atanasov et
                /// al. 2018).
                Tiles "tiles" "t" = tiles TilesRoom TilesParameters;
            }
        }
    };
}
pub(crate) use registry;
