// A shader without the sparse ensemble. Twin: decoder-core/src/no_ensemble.rs.

// No texture: no material of that method is bound.
fn texture_q20(_material: Material, _channel: Channel, _level: u32, _x: Axis, _y: Axis, _light: Taps, _view: Taps) -> i32 {
    return 0;
}
