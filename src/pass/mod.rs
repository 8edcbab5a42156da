//! One file per dispatch: name = `glsl/<name>.comp` = debug label = timer row.
