"""NIfTI-1 files for the scripts, with nothing but Python."""

import struct

# Data type: code in the header, bits, and the letter of `struct`.
INT16, FLOAT32 = (4, 16, "h"), (16, 32, "f")


def nifti(side, voxels, kind=INT16, volumes=1):
    """Volumes of side^3 voxels of 4 mm; `voxels` are their values, in the order of the file."""
    code, bits, letter = kind
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, 3 if volumes == 1 else 4, side, side, side, volumes, 1, 1, 1)
    struct.pack_into("<2h", head, 70, code, bits)
    struct.pack_into("<8f", head, 76, 1, 4, 4, 4, 1, 1, 1, 1)
    struct.pack_into("<2f", head, 108, 352, 1)
    struct.pack_into("<2h", head, 252, 0, 1)
    for row in range(3):
        axis = [0.0] * 4
        axis[row] = 4.0
        struct.pack_into("<4f", head, 280 + 16 * row, *axis)
    head[344:348] = b"n+1\0"
    return bytes(head) + struct.pack(f"<{volumes * side**3}{letter}", *voxels)
