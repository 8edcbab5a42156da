// Tone: linear radiance → values that a screen can show; twin of src/film/tone.rs.

// Luminance that the curve of Reinhard et al. maps to white.
const float TONE_WHITE = 4.0;
// Beyond this all is white, and infinity would give NaN.
const float TONE_LARGEST = 1e6;

// sRGB transfer function (IEC 61966-2-1).
vec3 srgb_from_linear(vec3 value) {
    vec3 curved = 1.055 * pow(value, vec3(1.0 / 2.4)) - 0.055;
    return mix(curved, 12.92 * value, lessThanEqual(value, vec3(0.0031308)));
}

// Reinhard et al. 2002, Eq. 4, on the luminance.
vec3 tone_reinhard(vec3 value) {
    float luminance = dot(value, LUMINANCE_WEIGHTS);
    return value * ((1.0 + luminance / (TONE_WHITE * TONE_WHITE)) / (1.0 + luminance));
}

// Fit of the ACES film curve, Narkowicz 2015.
vec3 tone_filmic(vec3 value) {
    return value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14);
}

// Returns display values from 0 to 1 of a finite pixel.
vec3 tone_map(vec3 value, float exposure, uint curve) {
    value = min(value * exposure, vec3(TONE_LARGEST));
    if (curve == CURVE_REINHARD) {
        value = tone_reinhard(value);
    } else if (curve == CURVE_FILMIC) {
        value = tone_filmic(max(value, vec3(0.0)));
    }
    return srgb_from_linear(clamp(value, vec3(0.0), vec3(1.0)));
}
