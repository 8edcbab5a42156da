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
