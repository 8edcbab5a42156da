//! Seen by the shaders of `product`, and by those of `visibility` and `haar` beside their own.

room! {
    specializations {
        // Specialization constants of `multiply_lobes`.
        /// Lobes of the environment.
        CONSTANT_ENVIRONMENT_LOBES;
        /// Largest number of lobes of a material in one view.
        CONSTANT_BRDF_LOBES;
        /// View elevations of a BRDF fit.
        CONSTANT_VIEWS;
        /// Largest number of lobes kept at a hit, in every pass over lobes.
        CONSTANT_KEPT_LOBES;
        /// 1 keeps lobes by coefficient instead of integral.
        CONSTANT_ORDER_BY_COEFFICIENT;
        /// Logarithm of an environment lobe's largest integral over 2π or largest amplitude, bits of a float.
        CONSTANT_STRONGEST_ENVIRONMENT_LOBE;

        // Specialization constants of `sample_lobes` and `sample_and_trace`.
        /// Share of directions from the BRDF, bits of a float.
        CONSTANT_BRDF_SHARE;
        /// Share of directions from the environment map, bits of a float.
        CONSTANT_ENVIRONMENT_SHARE;
        /// 1 draws elevations by a random walk, which is biased.
        CONSTANT_METROPOLIS;
    }

    constants {
        // Lobes and learned visibility.
        /// Lobes between two sums of their weights; a power of two up to 32.
        LOBES_PER_SUM = 16;
    }

    buffers {
        /// Environment lobes in world space, by integral: bandwidth · axis, ln(amplitude) − bandwidth.
        ENVIRONMENT_LOBES: texels Rgba32Float;
        /// Lobes of BRDF · cosine by material and view, likewise, in the frame of view and normal.
        BRDF_LOBES: texels Rgba32Float;
        /// First lobe of each material, and its lobes per view.
        MATERIAL_LOBES: texels Rg32Uint;
        /// Lobes of the product: lobe `l` of path `i` at `l · path_count + i`.
        LOBES: array uvec2, LOBE_TEXELS Rg32Uint;
        /// Number of lobes of each path.
        LOBE_COUNTS: array uint;
        /// Sums of the current weights up to every `LOBES_PER_SUM`th lobe of a path and to the
        /// last: sum `s` of path `i` at `s · path_count + i`.
        LOBE_SUMS: array float, LOBE_SUM_TEXELS R32Float;
        /// Bits of the lobes close to each cached direction (`close_lobes_index`).
        CLOSE_LOBES: array uint, CLOSE_LOBE_TEXELS R32Uint;
        /// Visibility caches by path or by film pixel: a head and `CACHE_CAPACITY` directions each.
        VISIBILITY_CACHE: array uint;
    }
}
