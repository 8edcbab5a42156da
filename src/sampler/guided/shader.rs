//! Seen by the shaders of `guided`.

use crate::shader::structs::*;

room! {
    specializations {
        /// Candidates of `sample_guided` from the BRDF, among all.
        CONSTANT_BRDF_CANDIDATES;
        /// Directions from the BRDF that `bounce_guided` chooses from.
        CONSTANT_BOUNCE_CANDIDATES;
    }

    constants {
        /// Slots probed for one key in the hash table of cells.
        GUIDE_PROBES = 8;
        /// Key of no cell.
        GUIDE_NO_KEY = 0xffff_ffff;
        /// First bit of a cell's share of the BRDF in the hash table, 256ths.
        GUIDE_SHARE_SHIFT = 24;
        /// Bit in the hash table of a cell whose parts may be cells; the cell's index is below it.
        GUIDE_REFINED = 1 << 23;
        /// Levels of the visibility in an entry.
        GUIDE_VISIBILITY_LEVELS = 64;
        /// Octaves of light by which rays are counted for the share of the BRDF, from 2^-32 on.
        GUIDE_SHARE_OCTAVES = 64;
        /// Words of a cell per region that are counted: trials, hits and the responses of the hits.
        GUIDE_COUNT_WORDS = 3;
        /// Fixed-point unit of a response: two million rays of the greatest one fit a word between rebuilds.
        GUIDE_RESPONSE_UNITS = 4096;
        /// Greatest response of one ray, a half: stronger reflection is the peak of a lobe, which the BRDF's
        /// own sampling finds, and few cells have one for all of their surfaces.
        GUIDE_RESPONSE_MOST = 2048;
        /// Samples after a rebuild whose rays are all counted.
        GUIDE_SAMPLES_THAT_ALL_TEACH = 16;
        /// After those, one in this many samples is counted.
        GUIDE_TEACHING_STEP = 4;
        /// Bins of arriving light along each side of the octahedral square.
        GUIDE_ARRIVAL_SIDE = 12;
        /// `PathCell::cell` at a specular surface, which has no cell.
        SPECULAR_CELL = 0xffff_fffe;
        /// Learning target of a shadow ray that teaches nothing.
        NOTHING_TO_LEARN = 0xffff_ffff;
        /// Evidence for the share of the BRDF of a shadow ray that was not drawn from two techniques.
        NO_SHARE_TO_LEARN = 0x1ff;
        /// First bit of a shadow ray's evidence for the share of the BRDF, 9 bits.
        LEARN_FROM_BRDF_SHIFT = 8;
        /// First bit of the response of a shadow ray.
        LEARN_RESPONSE_SHIFT = 17;
    }

    structs {
        /// Cells that a path's bounces teach.
        struct PathCell {
            /// Cell of its current vertex, `SPECULAR_CELL`, or `NOTHING_TO_LEARN` if it left the scene.
            cell: uint,
            /// Cell and direction that its last bounce ray teaches, or `NOTHING_TO_LEARN`.
            teaches: uint,
        }

        /// Mapping from places in the scene to cells of the guide.
        struct GuideParameters {
            /// Corner of the grids, metres.
            grid_origin: vec3,
            /// Edge of a cell of level 0, metres.
            finest_edge: float,
            /// Edge of a cell per metre of distance to the camera.
            edge_per_distance: float,
            /// Largest edge of a cell, metres.
            largest_edge: float,
            /// Regions of the environment.
            region_count: uint,
            /// Slots of the hash table minus one.
            table_mask: uint,
            /// Slots for missing keys minus one.
            missing_mask: uint,
        }
    }

    buffers {
        /// Grids of the cells, number of regions, and masks of the hash tables.
        GUIDE: one GuideParameters;
        /// Hash table of the cells: key; index, refined or not, and share of the BRDF.
        GUIDE_TABLE: texels Rg32Uint;
        /// Density and visibility of each region in each cell: a word each, as `guide_word` describes it.
        GUIDE_ENTRIES: texels R32Uint;
        /// Regions as `Partition::tables` lays them out.
        GUIDE_REGIONS: texels Rgba32Uint;
        /// Alias tables over the environment's cells in each region: threshold, alias.
        GUIDE_ALIASES: texels Rg32Uint;
        /// Region of every cell of the environment.
        GUIDE_REGION_OF_CELL: texels R16Uint;
        /// Rays traced, rays visible and their responses, by cell and region, since the last rebuild.
        GUIDE_COUNTS: array uint;
        /// Visible rays and their c p_B / q in 256ths, by cell and octave, since the last rebuild.
        GUIDE_SHARES: array uint;
        /// Keys of missing cells that passes looked for.
        GUIDE_MISSING: array uint;
        /// Count of each shadow ray, or `NOTHING_TO_LEARN`; octave of light, c p_B / q in 256ths
        /// (from bit `LEARN_FROM_BRDF_SHIFT`), response (from bit `LEARN_RESPONSE_SHIFT`).
        LEARN_TARGETS: array uvec2, LEARN_TARGET_TEXELS Rg32Uint;
        /// Current cell of each path, and the cell and direction that its bounce ray teaches.
        PATH_CELLS: array PathCell, PATH_CELL_TEXELS Rg32Uint;
        /// Learned light from other surfaces by cell and direction, relative to the cell's mean.
        GUIDE_ARRIVING: texels R32Float;
        /// Learned light that each cell reflects, in whole units.
        GUIDE_REFLECTED: texels R32Uint;
        /// Bounce rays and the light where they arrived, by cell and direction, since the last rebuild.
        GUIDE_ARRIVALS: array uint;
    }
}
