//! Seen by the shaders of `control-variates`.

room! {
    specializations {
        /// Share of the expected visibility that is the control variate, bits of a float.
        CONSTANT_CONTROL_SHARE;
        /// 1 chooses shadow rays where the records are in doubt, 0 by light alone.
        CONSTANT_CONTROL_CHOICE;
        /// 1 rounds the expected visibility to a bit in the control variate.
        CONSTANT_CONTROL_BITS;
        /// Bins of a record along each side of the square of directions.
        CONSTANT_RECORD_SIDE;
        /// Edge of a record's cube per metre of distance to the camera, bits of a float.
        CONSTANT_RECORD_EDGE;
        /// Largest edge of a record's cube, metres, bits of a float.
        CONSTANT_RECORD_LARGEST_EDGE;
    }

    constants {
        /// Visibility records; a power of two.
        VISIBILITY_RECORDS = 1 << 13;
    }

    buffers {
        /// Rays of the pilot, and the visible ones among them, by record and direction (`record_entry`).
        RECORD_COUNTS: array uint;
        /// Expected visibility by record and direction.
        RECORD_VISIBILITIES: texels R32Float;
    }
}
