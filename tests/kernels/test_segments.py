from batten.kernels.segments import segments_cross


def test_crossing_touching_and_apart():
    assert segments_cross(0.0, 0.0, 2.0, 2.0, 0.0, 2.0, 2.0, 0.0)
    assert not segments_cross(0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 0.0)  # a common end
    assert not segments_cross(0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 1.0, 1.0)  # an end on the other
    assert not segments_cross(0.0, 0.0, 1.0, 1.0, 0.0, 3.0, 3.0, 2.0)  # boxes apart
    assert not segments_cross(0.0, 0.0, 4.0, 4.0, 2.0, 1.0, 4.0, 0.0)  # boxes meet, segments do not
