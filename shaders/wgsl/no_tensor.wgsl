// A shader without the sparse tensor. Twin: decoder-core/src/no_tensor.rs.

// No textures: no material of that method is bound.
fn textures_q20(_material: Material, _level: u32, _x: Axis, _y: Axis, _light: Taps, _view: Taps) -> Values {
    return Values(0, 0, 0);
}
