"""A beat of a phantom: its image, drawn together about the heart and let go again.

usage: gated_phantom.py FOLDER OUT.nii.gz [GATES]

FOLDER holds spect.nii.gz and lv_truth.nii.gz of `ventriform phantom`. Writes a 4-D NIfTI file of 8 gates (or GATES).
End systole lies at three eighths of the cycle, where every length about the heart is a tenth shorter and the counts are
the same: a beat for checks of files, not of figures.
"""

import sys

import nibabel
import numpy as np

SHRINKAGE = 0.1
SYSTOLE = 0.375
RR_MS = 900


def zoomed(voxels, centre, scale):
    """The image with every length about the voxel index `centre` times `scale`, by linear interpolation."""
    for axis, middle in enumerate(centre):
        count = voxels.shape[axis]
        at = np.clip(middle + (np.arange(count) - middle) / scale, 0, count - 1)
        weights = np.clip(1 - np.abs(at[:, None] - np.arange(count)), 0, None)
        voxels = np.moveaxis(np.tensordot(weights, voxels, (1, axis)), 0, axis)
    return voxels / scale**3


def beat(folder, gates=8):
    """The gates, one after the other along the last axis, and the affine."""
    image = nibabel.load(f"{folder}/spect.nii.gz")
    wall = np.argwhere(np.asarray(nibabel.load(f"{folder}/lv_truth.nii.gz").dataobj) > 0)
    voxels = np.asarray(image.dataobj, float).clip(0)
    turns = (np.arange(gates) + 0.5) / gates
    way = np.where(turns < SYSTOLE, turns / SYSTOLE, (1 - turns) / (1 - SYSTOLE))
    contraction = (1 - np.cos(np.pi * way)) / 2
    moments = [zoomed(voxels, wall.mean(0), 1 - SHRINKAGE * share) for share in contraction]
    return np.stack(moments, 3).round(), image.affine


def main():
    folder, out = sys.argv[1:3]
    gates = int(sys.argv[3]) if len(sys.argv) > 3 else 8
    voxels, affine = beat(folder, gates)
    image = nibabel.Nifti1Image(voxels.astype(np.int16), affine)
    image.header.set_zooms([*image.header.get_zooms()[:3], RR_MS / 1000 / gates])
    image.header.set_xyzt_units("mm", "sec")
    nibabel.save(image, out)


if __name__ == "__main__":
    main()
