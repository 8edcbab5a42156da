// Density of `mis`: shadow rays from BRDF and environment, and the bounce ray that may escape to the
// environment. Multi-sample balance heuristic [Veach & Guibas 1995]. Solid angle measure.

// Share of shadow rays from the BRDF, in 256ths: with the bounce ray, half of all rays of the vertex.
uint mis_share(uint shadow_rays, uint bounce_rays) {
    return 128u * (shadow_rays - bounce_rays) / shadow_rays;
}

// Returns the density of all rays of a vertex together over its number of shadow rays.
float mis_pdf(float brdf_pdf, float environment_density, uint shadow_rays, uint bounce_rays) {
    float share = float(mis_share(shadow_rays, bounce_rays)) * (1.0 / 256.0);
    float pdf = share * brdf_pdf + (1.0 - share) * environment_density;
    return bounce_rays > 0u ? pdf + brdf_pdf / float(shadow_rays) : pdf;
}

// Turns of BRDF and light among the shadow rays of a group. They alternate by the share from a random
// start, so that a ray is from the BRDF with exactly that probability, and neither sequence has gaps.
struct MisTurns {
    // Bit of each ray of the group that is from the BRDF.
    uint from_brdf;
    // Index of the first ray of either technique in its own sequence.
    uint brdf_index;
    uint light_index;
};

// Turns of `ray_count` rays from `first_ray` on; `bits` are random, the same for pixels of a block.
MisTurns mis_turns(uint first_ray, uint ray_count, uint share, uint bits) {
    uint start = (bits & 1u) << 7u | ((bits >> 1u) & 127u);
    uint before = (first_ray * share + start) >> 8u;
    uint from_brdf = 0u;
    for (uint i = 0u; i < ray_count; ++i) {
        uint sum = ((first_ray + i) * share + start) & 255u;
        from_brdf |= sum + share >= 256u ? 1u << i : 0u;
    }
    return MisTurns(from_brdf, before, first_ray - before + (bits & 1u));
}
