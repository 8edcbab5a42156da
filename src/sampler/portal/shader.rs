//! Seen by the shaders of `portal`.

room! {
    specializations {
        /// Number of portals.
        CONSTANT_PORTALS;
        /// Share of the portals among directions that are not from the BRDF, bits of a float.
        CONSTANT_PORTAL_SHARE;
    }

    buffers {
        /// Portals, three texels each: corner, width; first axis, height; second axis.
        PORTALS: texels Rgba32Float;
    }
}
