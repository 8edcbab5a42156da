// Whole numbers divided by way of floats.

#ifndef DIVIDE_GLSL
#define DIVIDE_GLSL

// Quotient and remainder, where the quotient is below 2^22: by floats, corrected by one, since
// software devices divide integers lane by lane.
uvec2 divide(uint dividend, uint divisor) {
    uint quotient = uint(float(dividend) / float(divisor));
    uint remainder = dividend - quotient * divisor;
    if (remainder >= 0x80000000u) {
        quotient -= 1u;
        remainder += divisor;
    } else if (remainder >= divisor) {
        quotient += 1u;
        remainder -= divisor;
    }
    return uvec2(quotient, remainder);
}

#endif
