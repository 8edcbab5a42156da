// Whole numbers by way of floats.

// Returns the whole number below a number of size up to 2^22. Its bits are those of the sum with 1.5 * 2^23:
// software devices convert floats to integers lane by lane.
int whole(float number) {
    return floatBitsToInt(floor(number) + 12582912.0) - 0x4b400000;
}

// Returns quotient and remainder for a quotient below 2^22. Divides floats and corrects by one,
// since software devices divide integers lane by lane.
uvec2 divide(uint dividend, uint divisor) {
    uint quotient = uint(whole(float(dividend) / float(divisor)));
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
