"""A nuclear medicine (NM) image as a DICOM file, for the scripts."""

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian

from .gated_phantom import RR_MS

NM = "1.2.840.10008.5.1.4.1.1.20"
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def header(number):
    """An NM image without pixels and geometry, of patient and study `number`."""
    data = Dataset()
    data.SOPClassUID = NM
    data.SOPInstanceUID = f"1.2.826.0.1.3680043.10.999.{number}.3"
    data.StudyInstanceUID = f"1.2.826.0.1.3680043.10.999.{number}.1"
    data.SeriesInstanceUID = f"1.2.826.0.1.3680043.10.999.{number}.2"
    data.FrameOfReferenceUID = f"1.2.826.0.1.3680043.10.999.{number}.4"
    data.SpecificCharacterSet = "ISO_IR 192"
    data.PatientName, data.PatientID = "Phantom^Fritz", f"PH{number}"
    data.PatientBirthDate, data.PatientSex = "19600102", "O"
    data.StudyDate, data.StudyTime, data.StudyID = "20250115", "103000", "1"
    data.AccessionNumber, data.ReferringPhysicianName = "ACC", ""
    data.Modality, data.SeriesNumber, data.InstanceNumber = "NM", 2, 1
    data.Manufacturer = "none"
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
    return data


def save(data, frames, path):
    """Writes `frames`, [frame, row, column], with the header `data`."""
    data.Rows, data.Columns = frames.shape[1:]
    data.NumberOfFrames = len(frames)
    data.PixelData = frames.astype("<u2").tobytes()
    data["PixelData"].VR = "OW"
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = NM, data.SOPInstanceUID
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.file_meta = meta
    data.save_as(path, enforce_file_format=True)


def projections(path, voxels, spacing, number, views=30):
    """Projections (TOMO) of voxels[x, y, z], x to the left, y to the back, z to the head, cubes of `spacing` mm: half a
    turn clockwise from 225 degrees on, as PS3.3 C.8.4.11 counts them."""
    n, step = voxels.shape[0], 180 / views
    middle = (n - 1) / 2
    toward, across = np.meshgrid(np.arange(n) - middle, np.arange(n) - middle, indexing="ij")
    frames = []
    for view in range(views):
        angle = np.deg2rad(225 - step * view)
        x = np.sin(angle) * toward - np.cos(angle) * across + middle
        y = np.cos(angle) * toward + np.sin(angle) * across + middle
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        seen = (i >= 0) & (j >= 0) & (i < n - 1) & (j < n - 1)
        i, j = np.where(seen, i, 0), np.where(seen, j, 0)
        f, g = (x - i)[..., None], (y - j)[..., None]
        near = (1 - f) * (1 - g) * voxels[i, j] + f * (1 - g) * voxels[i + 1, j]
        far = (1 - f) * g * voxels[i, j + 1] + f * g * voxels[i + 1, j + 1]
        sums = ((near + far) * seen[..., None]).sum(0)
        frames.append(sums.T[::-1])
    data = header(number)
    data.ImageType = ["ORIGINAL", "PRIMARY", "TOMO", "EMISSION"]
    data.PixelSpacing = [float(f"{spacing:.9g}")] * 2
    data.FrameIncrementPointer = [0x00540010, 0x00540020, 0x00540050, 0x00540090]
    data.EnergyWindowVector = data.DetectorVector = data.RotationVector = [1] * views
    data.NumberOfEnergyWindows = data.NumberOfDetectors = data.NumberOfRotations = 1
    data.AngularViewVector = list(range(1, views + 1))
    detector, rotation = Dataset(), Dataset()
    detector.CollimatorType = "PARA"
    rotation.RotationDirection, rotation.StartAngle = "CW", 225
    rotation.AngularStep, rotation.ScanArc = float(f"{step:.9g}"), 180
    rotation.NumberOfFramesInRotation, rotation.ActualFrameDuration = views, 20000
    data.DetectorInformationSequence, data.RotationInformationSequence = [detector], [rotation]
    frames = np.stack(frames)
    save(data, np.round(frames * (1000 / frames.max())), path)


def nm(path, voxels, affine, number, gates=1):
    """A reconstructed NM image of voxels[i, j, k], the same in all gates, or voxels[i, j, k, gate]; `affine` maps
    indices to LPS mm and has right angles."""
    steps = affine[:3, :3]
    spacing = np.linalg.norm(steps, axis=0)
    rows, columns = steps[:, 0] / spacing[0], steps[:, 1] / spacing[1]
    sign = np.sign(np.dot(np.cross(rows, columns), steps[:, 2]))
    data = header(number)
    kind = "RECON GATED TOMO" if gates > 1 else "RECON TOMO"
    data.ImageType = ["DERIVED", "PRIMARY", kind, "EMISSION"]
    data.PixelSpacing = [float(f"{spacing[1]:.9g}"), float(f"{spacing[0]:.9g}")]
    data.SpacingBetweenSlices = float(f"{sign * spacing[2]:.9g}")
    data.SliceThickness = float(f"{spacing[2]:.9g}")
    slices = voxels.shape[2]
    order = np.arange(gates * slices)[::-1]  # the file's frames in another order than the slices
    data.SliceVector = [int(f) % slices + 1 for f in order]
    if gates > 1:
        data.FrameIncrementPointer = [0x00540060, 0x00540070, 0x00540080]
        data.RRIntervalVector = [1] * len(order)
        data.TimeSlotVector = [int(f) // slices + 1 for f in order]
        beats, gating = Dataset(), Dataset()
        beats.FrameTime = f"{RR_MS / gates:.6g}"
        beats.NominalInterval, beats.LowRRValue, beats.HighRRValue = RR_MS, 800, 1000
        beats.IntervalsAcquired, beats.IntervalsRejected = 400, 20
        gating.DataInformationSequence = [beats]
        data.GatedInformationSequence = [gating]
    else:
        data.FrameIncrementPointer = 0x00540080
    detector = Dataset()
    detector.ImageOrientationPatient = [float(f"{x:.10f}") for x in (*rows, *columns)]
    detector.ImagePositionPatient = [float(f"{x:.6f}") for x in affine[:3, 3]]
    data.DetectorInformationSequence = [detector]
    if voxels.ndim == 3:
        voxels = np.stack([voxels] * gates, 3)
    frames = voxels.transpose(3, 2, 1, 0).reshape(-1, *voxels.shape[1::-1])[order]
    save(data, frames, path)
