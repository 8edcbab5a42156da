//! Fenestra: a physically based renderer for scenes lit by an environment map, in Vulkan compute. It
//! learns which directions are blocked and stops shooting shadow rays there.
//!
//! ```rust,no_run
//! use fenestra::{
//!     gpu::Device, sampler::Sampler, scene::Scene, session::{Event, Rules, Session, Settings},
//! };
//!
//! # fn main() -> fenestra::Result<()> {
//! let scene = Scene::load("scenes/meeting_room.toml".as_ref())?;
//! let device = Device::open(None, false)?;
//! let settings = Settings { sampler: Sampler::Guided, ..Settings::default() };
//! let mut session = Session::new(&device, &scene, settings)?;
//! let rules = Rules { error: Some(0.02), seconds: Some(60.0), ..Rules::default() };
//! session.run(&rules, &mut |event: &Event<'_>| eprintln!("{event}"))?;
//! session.image(&[])?.write_exr("meeting_room.exr".as_ref())?;
//! # Ok(())
//! # }
//! ```
//!
//! `docs/examples/render.rs` adds checkpoints, `docs/examples/study.rs` compares two samplers.
//! `docs/architecture.md` follows one sample from the scene file to the image.
//!
//! # Pipeline
//!
//! | stage | module | shader in `glsl/` |
//! |---|---|---|
//! | scene file → validated [`Scene`](scene::Scene) | [`scene`] | `include/environment` |
//! | images on surfaces | [`scene::texture`], [`surface`] | `include/texture` |
//! | materials → tables, values | [`brdf`] | `include/brdf` |
//! | lobes and their kernel | [`srbf`] | `include/srbf` |
//! | maps and BRDFs → lobes | [`fit`] | |
//! | triangles → wide BVH | [`accel`] | `include/bvh` |
//! | frames, random numbers | [`math`] | `include/frame`, `include/random`, |
//! | | | `include/spherical_rectangle` |
//! | constants, structs, buffers of both languages | [`shader`] | `include/layout` |
//! | Vulkan | [`gpu`] | |
//! | passes of a wave, in their order | [`pass`] | `camera`, `trace`, `texture`, `emit`, `sample`, |
//! | | | `sample_lamps`, `shadow`, `gather`, `features`, `bounce`, `deposit`, |
//! | | | `accumulate` |
//! | `product` | [`sampler::product`] | `product/`: `multiply_lobes`, `sample_lobes` |
//! | `visibility`, on top of it | [`sampler::visibility`] | `visibility/`: `reweight`, `sample_and_trace`, |
//! | | | `count_entries` |
//! | `guided` | [`sampler::guided`] | `guided/`: `sample_guided`, `learn`, `show_cells`, |
//! | | | `bounce_guided`, `learn_arrivals` |
//! | `portal` | [`sampler::portal`] | `portal/`: `sample_portals` |
//! | `haar` | [`sampler::haar`] | `haar/`: `multiply_nodes`, `sample_nodes`, `lower_nodes` |
//! | `control-variates` | [`sampler::control_variates`] | `control_variates/`: `record_visibility`, |
//! | | | `sample_controlled` |
//! | `tiles` | [`sampler::tiles`] | `tiles/`: `count_tiles`, `sample_tiles` |
//! | scene, settings, device → sums: loop, stop rules, checkpoints | [`session`] | |
//! | device → is it right? | [`self_test`] | `trace`, `list_paths`, `shadow` |
//! | sums → image files | [`film`] | |
//! | scene → files of other renderers | [`scene::export`] | |
//! | runs of several samplers → report | [`study`] | |
//! | ray rates beside those of the CPU | [`mod@bench`] | |
//! | a window in which the camera moves | [`view`] | `view/`: `show`, `compose` |
//! | command line | `cli`, `command` | |
//!
//! # Notation
//!
//! Directions point away from the surface; `outgoing_direction` leads to the viewer, `incident_direction` to
//! the light; names that end in `_local` are in the shading frame, whose z axis is the shading normal.
//! Densities (`pdf`) are per steradian unless named otherwise. Radiance is linear Rec.709.
//!
//! # Bibliography
//!
//! Comments in Rust and GLSL cite these by authors and year.
//!
//! - \[Abramowitz & Stegun 1964\] *Handbook of Mathematical Functions*, National Bureau of
//!   Standards.
//! - \[Aila & Laine 2009\] "Understanding the Efficiency of Ray Traversal on GPUs", High
//!   Performance Graphics.
//! - \[Appleby 2011\] MurmurHash3, <https://github.com/aappleby/smhasher>.
//! - \[Arthur & Vassilvitskii 2007\] "k-means++: The Advantages of Careful Seeding", SODA.
//! - \[Atanasov et al. 2018\] "Adaptive Environment Sampling on CPU and GPU", SIGGRAPH Talks.
//! - \[Banerjee et al. 2005\] "Clustering on the Unit Hypersphere using von Mises-Fisher
//!   Distributions", JMLR 6.
//! - \[Blanco-Muriel et al. 2001\] "Computing the Solar Vector", Solar Energy 70(5).
//! - \[Burke et al. 2005\] "Bidirectional Importance Sampling for Direct Illumination",
//!   Eurographics Symposium on Rendering.
//! - \[Burley 2020\] "Practical Hash-based Owen Scrambling", JCGT 9(4).
//! - \[Chen & Asau 1974\] "On Generating Random Variates from an Empirical Distribution", AIIE
//!   Transactions 6(2).
//! - \[Chiang et al. 2016\] "A Practical and Controllable Hair and Fur Model for Production Path
//!   Tracing", Computer Graphics Forum 35(2).
//! - \[CIE 015:2018\] *Colorimetry*, fourth edition.
//! - \[Cigolle et al. 2014\] "A Survey of Efficient Representations for Independent Unit Vectors",
//!   JCGT 3(2).
//! - \[Clarberg 2008\] "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", Journal of Graphics
//!   Tools 13(3).
//! - \[Clarberg & Akenine-Möller 2008\] "Practical Product Importance Sampling for Direct
//!   Illumination", Computer Graphics Forum 27(2).
//! - \[Clarberg & Akenine-Möller 2008b\] "Exploiting Visibility Correlation in Direct Illumination",
//!   Computer Graphics Forum 27(4).
//! - \[Clarberg et al. 2005\] "Wavelet Importance Sampling: Efficiently Evaluating Products of
//!   Complex Functions", SIGGRAPH.
//! - \[Douc et al. 2007\] "Convergence of Adaptive Mixtures of Importance Sampling Schemes", Annals
//!   of Statistics 35(1); "Minimum Variance Importance Sampling via Population Monte Carlo", ESAIM:
//!   Probability and Statistics 11.
//! - \[Duff et al. 2017\] "Building an Orthonormal Basis, Revisited", JCGT 6(1).
//! - \[Dupuy & Benyoub 2023\] "Sampling Visible GGX Normals with Spherical Caps", Computer
//!   Graphics Forum 42(8).
//! - \[Dupuy & Jakob 2018\] "An Adaptive Parameterization for Efficient Material Acquisition and
//!   Rendering", ACM Transactions on Graphics 37(6).
//! - \[Eto & Tokuyoshi 2023\] "Bounded VNDF Sampling for Smith–GGX Reflections", SIGGRAPH Asia
//!   Technical Communications.
//! - \[Friedman & Jones 2015\] "Fully Automatic ID Mattes with Support for Motion Blur and
//!   Transparency", SIGGRAPH Posters.
//! - \[Fritsch & Butland 1984\] "A Method for Constructing Local Monotone Piecewise Cubic
//!   Interpolants", SIAM Journal on Scientific and Statistical Computing 5(2).
//! - \[Gibson 1998\] "Constrained Elastic Surface Nets", MICCAI.
//! - \[Heitz 2014\] "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT
//!   3(2).
//! - \[Hosek & Wilkie 2012\] "An Analytic Model for Full Spectral Sky-Dome Radiance", ACM Transactions
//!   on Graphics 31(4).
//! - \[Hosek & Wilkie 2013\] "Adding a Solar-Radiance Function to the Hošek–Wilkie Skylight Model",
//!   IEEE Computer Graphics and Applications 33(3).
//! - \[IEC 61966-2-1:1999\] *Default RGB colour space – sRGB*.
//! - \[ISO/CIE 11664-2:2022\] *Colorimetry – CIE standard illuminants*.
//! - \[Jarzynski & Olano 2020\] "Hash Functions for GPU Rendering", JCGT 9(3).
//! - \[Jensen et al. 2001\] "A Practical Model for Subsurface Light Transport", SIGGRAPH.
//! - \[Joe & Kuo 2008\] "Constructing Sobol Sequences with Better Two-Dimensional Projections",
//!   SIAM Journal on Scientific Computing 30(5).
//! - \[Karlík et al. 2019\] "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance
//!   Sampling", ACM Transactions on Graphics 38(6).
//! - \[Kelemen & Szirmay-Kalos 2001\] "A Microfacet Based Coupled Specular-Matte BRDF Model with
//!   Importance Sampling", Eurographics short presentations.
//! - \[Knuth 1997\] *The Art of Computer Programming*, volume 2, third edition, section 4.2.2.
//! - \[Laine & Karras 2011\] "Stratified Sampling for Stochastic Transparency", Computer Graphics
//!   Forum 30(4).
//! - \[Lam 1985\] "Metamerism and Colour Constancy", PhD thesis, University of Bradford.
//! - \[Lavenberg & Welch 1981\] "A Perspective on the Use of Control Variables to Increase the
//!   Efficiency of Monte Carlo Simulations", Management Science 27(3).
//! - \[Matusik et al. 2003\] "A Data-Driven Reflectance Model", ACM Transactions on Graphics
//!   22(3).
//! - \[Meister & Bittner 2018\] "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy
//!   Construction", IEEE TVCG 24(3); "Parallel Reinsertion for Bounding Volume Hierarchy
//!   Optimization", Computer Graphics Forum 37(2).
//! - \[Meisters 1975\] "Polygons Have Ears", American Mathematical Monthly 82(6).
//! - \[Mikkelsen 2008\] *Simulation of Wrinkled Surfaces Revisited*, master's thesis, University of
//!   Copenhagen.
//! - \[Moshier 1992\] Cephes Mathematical Library.
//! - \[Narkowicz 2015\] "ACES Filmic Tone Mapping Curve",
//!   <https://knarkowicz.wordpress.com/2016/01/06/aces-filmic-tone-mapping-curve/>.
//! - \[Neyman 1938\] "Contribution to the Theory of Sampling Human Populations", Journal of the American
//!   Statistical Association 33(201).
//! - \[Nocedal & Wright 2006\] *Numerical Optimization*, second edition, Springer.
//! - \[Pharr & Humphreys 2010\] *Physically Based Rendering*, second edition, Morgan Kaufmann.
//! - \[Quilez 2008\] "Distance functions", <https://iquilezles.org/articles/distfunctions/>.
//! - \[Reinhard et al. 2002\] "Photographic Tone Reproduction for Digital Images", ACM Transactions on
//!   Graphics 21(3).
//! - \[Rusinkiewicz 1998\] "A New Change of Variables for Efficient BRDF Representation",
//!   Eurographics Workshop on Rendering.
//! - \[Schlick 1994\] "An Inexpensive BRDF Model for Physically-based Rendering", Computer
//!   Graphics Forum 13(3).
//! - \[Shirley & Chiu 1997\] "A Low Distortion Map Between Disk and Square", Journal of Graphics
//!   Tools 2(3).
//! - \[Shun & Blelloch 2014\] "Phase-Concurrent Hash Tables for Determinism", SPAA.
//! - \[Steele et al. 2014\] "Fast Splittable Pseudorandom Number Generators", OOPSLA.
//! - \[Talbot et al. 2005\] "Importance Resampling for Global Illumination", Eurographics
//!   Symposium on Rendering.
//! - \[Thürmer & Wüthrich 1998\] "Computing Vertex Normals from Polygonal Facets", Journal of
//!   Graphics Tools 3(1).
//! - \[Tokuyoshi 2022\] "Accurate Diffuse Lighting from Spherical Gaussian Lights", SIGGRAPH
//!   Posters.
//! - \[Tsai & Shih 2006\] "All-Frequency Precomputed Radiance Transfer using Spherical Radial
//!   Basis Functions and Clustered Tensor Approximation", ACM Transactions on Graphics 25(3).
//! - \[Tsai et al. 2008\] "Importance Sampling of Products from Illumination and BRDF Using
//!   Spherical Radial Basis Functions", The Visual Computer 24.
//! - \[Turk 1994\] "The PLY Polygon File Format", Stanford University.
//! - \[Ureña, Fajardo & King 2013\] "An Area-Preserving Parametrization for Spherical
//!   Rectangles", Computer Graphics Forum 32(4).
//! - \[van Oosterom & Strackee 1983\] "The Solid Angle of a Plane Triangle", IEEE Transactions on
//!   Biomedical Engineering BME-30(2).
//! - \[Veach & Guibas 1995\] "Optimally Combining Sampling Techniques for Monte Carlo Rendering",
//!   SIGGRAPH.
//! - \[Vegdahl 2021\] "Building a Better LK Hash",
//!   <https://psychopath.io/post/2021_01_30_building_a_better_lk_hash>.
//! - \[Vévoda et al. 2018\] "Bayesian Online Regression for Adaptive Direct Illumination
//!   Sampling", ACM Transactions on Graphics 37(4).
//! - \[Vorba et al. 2014\] "On-line Learning of Parametric Mixture Models for Light Transport
//!   Simulation", ACM Transactions on Graphics 33(4).
//! - \[Vose 1991\] "A Linear Algorithm for Generating Random Numbers with a Given
//!   Distribution", IEEE Transactions on Software Engineering 17(9).
//! - \[Wächter & Binder 2019\] "A Fast and Robust Method for Avoiding Self-Intersection", Ray
//!   Tracing Gems, chapter 6.
//! - \[Wald et al. 2014\] "Embree: A Kernel Framework for Efficient CPU Ray Tracing", ACM Transactions on
//!   Graphics 33(4).
//! - \[Walker 1977\] "An Efficient Method for Generating Discrete Random Variables with General
//!   Distributions", ACM Transactions on Mathematical Software 3(3).
//! - \[Walter et al. 2007\] "Microfacet Models for Refraction through Rough Surfaces",
//!   Eurographics Symposium on Rendering.
//! - \[Wang et al. 2008\] "Computation of Rotation Minimizing Frames", ACM Transactions on
//!   Graphics 27(1).
//! - \[Winitzki 2008\] "A Handy Approximation for the Error Function and its Inverse".
//! - \[Woop et al. 2013\] "Watertight Ray/Triangle Intersection", JCGT 2(1).
//! - \[Wu & Shih 2009\] Y.-T. Wu, advised by Z.-C. Shih, "Visibility-Guided Importance Sampling",
//!   master's thesis, National Chiao Tung University; "the thesis" in comments.
//! - \[Ylitie et al. 2017\] "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//!   BVHs", High Performance Graphics.
//! - \[Yuksel et al. 2009\] "On the Parameterization of Catmull-Rom Curves", SIAM/ACM Joint
//!   Conference on Geometric and Physical Modeling.

#![warn(clippy::print_stderr, clippy::print_stdout)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "tests may panic"))]

// Pipeline order; rustfmt sorts within a group.
pub mod brdf;
pub mod srbf;
pub mod surface;

pub mod fit;

pub mod accel;
pub mod math;
pub mod shader;

pub mod gpu;
pub mod pass;
pub mod sampler;

pub mod session;

pub mod self_test;

pub mod film;
pub mod study;

pub mod bench;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod command;
pub mod view;

mod terminal;

pub use fenestra_scene::{self as scene, Error, Result};
use fenestra_scene::{error, export, files, memory, stage, texture};
