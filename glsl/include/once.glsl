// Branches that software devices skip: they run the body of an `if` wherever one lane of a subgroup may take
// it, with the other lanes masked, but end a loop as soon as all lanes have left it.

// Runs the statement that follows if `condition` holds. For bodies that cost more than a test of all lanes.
#define ONCE_IF(condition) for (uint once = uint(condition); once > 0u; --once)
