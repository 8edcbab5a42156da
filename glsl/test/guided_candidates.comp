// Densities (solid angle) of a candidate or a given direction. For tests/guided_candidates.rs.
#version 460

#include "guided/candidates.glsl"
#include "test/answers.glsl"

struct CandidateQuery {
    // 1 draws a candidate, 0 takes the direction.
    uint draws;
    uint ray;
    // Number of the candidate within its ray.
    uint candidate;
    vec3 direction;
};

struct CandidateAnswer {
    vec3 direction;
    float pdf;
    float brdf_pdf;
    float guided_pdf;
};

CandidateAnswer answer(CandidateQuery query) {
    Vertex vertex = load_vertex(0u, load_hit(0u));
    uint cell = guide_cell_index(guide_cell_of(vertex));
    uint first = cell * guide.region_count;
    Guided guided;
    if (query.draws == 0u) {
        guided = locate_guided(first, evaluate_world(vertex, query.direction));
    } else if (query.candidate < BRDF_CANDIDATES) {
        uint number = query.ray * BRDF_CANDIDATES + query.candidate;
        guided = draw_brdf_candidate(vertex, first, number);
    } else {
        uint guided_count = CANDIDATES - BRDF_CANDIDATES;
        uint number = query.ray * guided_count + query.candidate - BRDF_CANDIDATES;
        guided = draw_candidate(vertex, first, number);
    }
    return CandidateAnswer(
        guided.sampled.direction, candidates_pdf(guided), guided.sampled.brdf_pdf,
        guided_pdf(guided));
}

ANSWER_QUERIES(CandidateQuery, CandidateAnswer, answer)
