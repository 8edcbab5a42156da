// Buffers and main of probes that answer one query an invocation.

#include "layout.glsl"

// Runs `answer` on every Query and writes the Answer.
#define ANSWER_QUERIES(Query, Answer, answer) \
    layout(scalar, PLACE_probe_input) readonly buffer Queries { \
        Query queries[]; \
    }; \
    layout(scalar, PLACE_probe_output) writeonly buffer Answers { \
        Answer answers[]; \
    }; \
    void main() { \
        uint index = gl_GlobalInvocationID.x; \
        if (index < uint(queries.length())) { \
            answers[index] = answer(queries[index]); \
        } \
    }
