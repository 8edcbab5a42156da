// Chooses directions at every hit of the wave by learned visibility. Writes one shadow ray for each
// with its unoccluded contribution, its count for learn.comp, and the keys of missing cells.
//
// The cells depend on earlier samples of the same pixels, so each rebuild starts a new sequence
// with its own scramble. Samples between two rebuilds read the same cells and may be stratified.
#version 460

#include "guided/candidates.glsl"
#include "path_list.glsl"
#include "reservoir.glsl"
#include "turns.glsl"

WRITES(learn_targets)
WRITES(path_cells)

// Offsets from the first dimension of a vertex, for independent numbers.
const uint DIMENSION_GUIDE_TECHNIQUE = 6u;
const uint DIMENSION_GUIDE_RESAMPLING = 7u;

// Share of candidates chosen without regard to visibility.
const float UNGUIDED_CHOICE = 0.1;

// Share of rays from the BRDF in the one-sample model, in 256ths, if the cell has learned none.
uint brdf_share(Material material) {
    uint share = 77u;
    if (is_diffuse(material)) {
        share = 26u;
    } else if (is_principled(material) && material.ior < 0.5) {
        // Most light of a principled dielectric comes from its diffuse base.
        share = material.alpha > 0.1 ? 26u : 77u;
    } else if (!is_kind(material, MATERIAL_MEASURED)) {
        share = material.alpha > 0.3 ? 26u : (material.alpha > 0.1 ? 77u : 128u);
    }
    return share;
}

// Least BRDF share at vertices that the camera does not see, in 256ths. Few rays reach their cells,
// and light that the BRDF favours and the guide believes blocked weighs as much as the path does.
const uint LEAST_LATER_SHARE = 40u;

// Writes a ray that contributes integrand * factor, and what it teaches. `from_brdf` is the BRDF's
// part of its density in the one-sample model, in 256ths. There, at vertices that the camera sees,
// untraced directions without a contribution (mostly below the horizon) count as blocked. Resampled
// candidates are not known one by one; at later vertices such rays did not pay
// (docs/experiments.md, directions_that_bring_nothing).
void finish(uint index, uint first, Guided guided, float factor, uint from_brdf) {
    vec3 contribution = guided.sampled.integrand * factor;
    write_ray(index, guided.sampled.direction, contribution);
    int exponent = int(floatBitsToUint(luminance(contribution)) >> 23u) - 127;
    uint octave = uint(clamp(
        exponent + int(GUIDE_SHARE_OCTAVES / 2u), 0, int(GUIDE_SHARE_OCTAVES) - 1));
    // BRDF * cosine, weighted by the light's colours: luminance and map density agree but for the
    // change of sin(theta) within a row.
    float light = guided.sampled.environment_pdf * parameters.environment_total * 2.0 * PI * PI;
    float response = light > 0.0 ? luminance(guided.sampled.integrand) / light : 0.0;
    uint response_units = uint(whole(clamp(
        response * float(GUIDE_RESPONSE_UNITS) + 0.5, 1.0, float(GUIDE_RESPONSE_MOST))));
    bool teaches =
        contribution != vec3(0.0) || (CANDIDATES == 1u && wave.vertex == 0u);
    learn_targets[index] = uvec2(
        teaches ? first + guided.region : NOTHING_TO_LEARN,
        octave | (CANDIDATES == 1u ? from_brdf : NO_SHARE_TO_LEARN) << LEARN_FROM_BRDF_SHIFT
            | response_units << LEARN_RESPONSE_SHIFT);
}

// Writes a ray of the one-sample model: balance heuristic over BRDF and guide.
void finish_one(uint index, uint first, Guided guided, float share) {
    float pdf = share * guided.sampled.brdf_pdf + (1.0 - share) * guided_pdf(guided);
    float factor = pdf > 0.0 ? 1.0 / pdf : 0.0;
    uint from_brdf =
        uint(whole(256.0 * min(share * guided.sampled.brdf_pdf * factor, 1.0) + 0.5));
    finish(index, first, guided, factor, from_brdf);
}

// Candidate chosen with probability 0.9 guided / guided_sum + 0.1 unguided / unguided_sum, which
// bounds the estimate where the guide is wrong.
struct Resampled {
    Guided chosen;
    float chosen_pdf;
    float chosen_guided;
    float chosen_unguided;
    float guided_sum;
    float unguided_sum;
    bool is_unguided;
    Reservoir reservoir;
};

void add_to(inout Resampled ray, Guided candidate) {
    float pdf = candidates_pdf(candidate);
    float unguided = pdf > 0.0 ? luminance(candidate.sampled.integrand) / pdf : 0.0;
    float guided = unguided * candidate.entry.visibility;
    ray.guided_sum += guided;
    ray.unguided_sum += unguided;
    float weight = ray.is_unguided ? unguided : guided;
    if (reservoir_takes(ray.reservoir, weight, weight)) {
        ray.chosen = candidate;
        ray.chosen_pdf = pdf;
        ray.chosen_guided = guided;
        ray.chosen_unguided = unguided;
    }
}

void sample_path(uint path) {
    uint path_count = wave_path_count();
    Hit hit = load_hit(path);
    if (hit.material == NO_MATERIAL) {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            learn_targets[i * path_count + path] = uvec2(NOTHING_TO_LEARN);
        }
        path_cells[path].cell =
            hit.triangle == NO_TRIANGLE ? NOTHING_TO_LEARN : SPECULAR_CELL;
        return;
    }
    Vertex vertex = load_vertex(path, hit);
    GuideCell found = guide_cell_of(vertex);
    uint cell = guide_cell_index(found);
    // Note the cell for the bounce that arrived here and the one that leaves.
    path_cells[path].cell = cell;
    uint learned_share = found.found >> GUIDE_SHARE_SHIFT;
    uint first = cell * guide.region_count;
    // Number the rays through all samples since the rebuild: they share one sequence.
    uint first_ray = (vertex.index.sample_index - wave.epoch_start) * wave.total_shadow_rays
        + wave.first_shadow_ray;

    if (CANDIDATES == 1u) {
        uint share = learned_share > 0u ? learned_share : brdf_share(vertex.reflector.material);
        share = wave.vertex > 0u ? max(share, LEAST_LATER_SHARE) : share;
        // Pixels of a block start alike.
        uint start = hash_4d(uvec4(
            film_block_place(vertex.index).yx, vertex.dimension + DIMENSION_GUIDE_TECHNIQUE,
            wave.epoch_seed)).x & 255u;
        float probability = float(share) * (1.0 / 256.0);
        Turns turns = turns_from(first_ray, share, start);
        TAKE_ALL_TURNS(
            turns,
            finish_one(
                ray * path_count + path, first, draw_candidate(vertex, first, index), probability),
            finish_one(
                ray * path_count + path, first, draw_brdf_candidate(vertex, first, index),
                probability))
    } else {
        for (uint i = 0u; i < wave.shadow_ray_count; ++i) {
            uvec2 bits = epoch_bits(vertex, first_ray + i, DIMENSION_GUIDE_RESAMPLING);
            Guided none = Guided(
                DirectionSample(vec3(0.0), vec3(0.0), 0.0, 0.0), 0u, GuideEntry(0.0, 0.0));
            Resampled ray = Resampled(
                none, 0.0, 0.0, 0.0, 0.0, 0.0, unit_float(bits.x) < UNGUIDED_CHOICE,
                reservoir_start(unit_float(bits.y)));
            for (uint c = 0u; c < BRDF_CANDIDATES; ++c) {
                uint index = (first_ray + i) * BRDF_CANDIDATES + c;
                add_to(ray, draw_brdf_candidate(vertex, first, index));
            }
            for (uint c = 0u; c < CANDIDATES - BRDF_CANDIDATES; ++c) {
                uint index = (first_ray + i) * (CANDIDATES - BRDF_CANDIDATES) + c;
                add_to(ray, draw_candidate(vertex, first, index));
            }
            float factor = 0.0;
            if (ray.chosen_unguided > 0.0 && ray.guided_sum > 0.0) {
                float chance =
                    (1.0 - UNGUIDED_CHOICE) * ray.chosen_guided / ray.guided_sum
                    + UNGUIDED_CHOICE * ray.chosen_unguided / ray.unguided_sum;
                factor = 1.0 / (float(CANDIDATES) * ray.chosen_pdf * chance);
            }
            finish(i * path_count + path, first, ray.chosen, factor, 0u);
        }
    }
}

WALK_PATHS(sample_path)
