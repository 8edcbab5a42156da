//! Seen by the shaders of `tiles`.

room! {
    specializations {
        /// Number of tiles of the environment.
        CONSTANT_TILES;
        /// 1 draws all rays through tiles, for the pilot to learn from.
        CONSTANT_TILES_LEARN;
    }

    constants {
        /// Parts in which probabilities of tiles are counted: single precision holds them exactly.
        TILE_SCALE = 1 << 24;
        /// Parts in which the squared cosine of a visible ray is counted.
        TILE_RESPONSE_UNITS = 64;
    }

    buffers {
        /// Rays of the pilot, and the squared cosines of the visible ones in 64ths, by sector and tile.
        TILE_COUNTS: array uint;
        /// Probability of each tile over its share of the map's energy, and the sum of probabilities up
        /// to and including it in `TILE_SCALE`ths, by sector and tile.
        TILE_ENTRIES: texels Rg32Uint;
        /// Tiles: first alias entry, columns, rows, first row · 65,536 + first column.
        TILE_REGIONS: texels Rgba32Uint;
        /// Alias tables over the environment's cells in each tile: threshold, alias.
        TILE_ALIASES: texels Rg32Uint;
        /// Tile of every cell of the environment.
        TILE_OF_CELL: texels R16Uint;
    }
}
