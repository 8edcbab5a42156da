// Choice of one among candidates as they come, in proportion to their weights, without keeping the others:
// resampled importance sampling. [Talbot et al. 2005].

struct Reservoir {
    // Sum of the weights of all candidates, and target of the chosen one: its weight times its density.
    float sum;
    float target;
    // Random number in [0, 1), rescaled after each choice for the next.
    float u;
};

Reservoir reservoir_start(float u) {
    return Reservoir(0.0, 0.0, u);
}

// Tests whether a candidate takes the place of the one chosen before.
bool reservoir_takes(inout Reservoir reservoir, float weight, float target) {
    reservoir.sum += weight;
    float probability = weight > 0.0 ? weight / reservoir.sum : 0.0;
    bool is_chosen = reservoir.u < probability;
    reservoir.u = is_chosen ? reservoir.u / probability
                            : (reservoir.u - probability) / max(1.0 - probability, 1e-7);
    reservoir.target = is_chosen ? target : reservoir.target;
    return is_chosen;
}

// Factor on the integrand of the chosen one among `count` candidates: mean weight / target, Eq. 6.
float reservoir_factor(Reservoir reservoir, uint count) {
    return reservoir.target > 0.0 ? reservoir.sum / (float(count) * reservoir.target) : 0.0;
}
