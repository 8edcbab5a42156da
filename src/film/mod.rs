//! Radiometric images: sums of samples on their way to files.
