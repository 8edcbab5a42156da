//! Seen by the shaders of `visibility` beside what those of `product` see; by those of `haar` in part.

room! {
    specializations {
        /// τ, closeness in deviations of a lobe, bits of a float.
        CONSTANT_THRESHOLD_SCALE;
        /// 1 uses one closeness for lobes of all bandwidths.
        CONSTANT_FIXED_THRESHOLD;
        /// Directions that a visibility cache holds; 0 without caches.
        CONSTANT_CACHE_CAPACITY;
        /// 1 keeps a cache for all samples of a pixel, 0 for one hit.
        CONSTANT_CACHE_OF_PIXEL;
        /// k of V = (1 / (1 + Num))^k, bits of a float.
        CONSTANT_VISIBILITY_EXPONENT;
    }
}
