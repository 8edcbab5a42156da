//! Seen by the shaders of `haar`.

room! {
    specializations {
        /// Base-2 logarithm of the nodes along each side of the square, at least 3.
        CONSTANT_HAAR_LEVEL;
        /// The same of the texels of the environment, more than that of the nodes.
        CONSTANT_HAAR_DEPTH;
    }

    buffers {
        /// Means of the environment's luminance over the four children of each node, level by level.
        HAAR_TREE: texels Rgba32Float;
        /// Direction to the centre of each node of the product.
        HAAR_CENTRES: texels Rgba32Float;
        /// Nodes of the product by fours, halves: quad `q` of path `i` at `q · path_count + i`.
        HAAR_NODES: array uvec2, HAAR_NODE_TEXELS Rgba16Float;
        /// Sums of the weights below the children of each coarse node: node `n` of path `i` at
        /// `n · path_count + i`.
        HAAR_SUMS: array vec4, HAAR_SUM_TEXELS Rgba32Float;
        /// Blocked directions: their number of path `i` at `i`, the `k`th at `k · path_count + i`.
        HAAR_CACHE: array uint;
    }
}
