//! Off-line fits of environment maps and BRDFs into spherical radial basis functions.
