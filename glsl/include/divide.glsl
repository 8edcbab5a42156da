// Division of whole numbers by way of floats.

// Returns quotient and remainder for a quotient below 2^22. Divides floats and corrects by one,
// since software devices divide integers lane by lane.
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
