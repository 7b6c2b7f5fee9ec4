"""A nuclear medicine (NM) image as a DICOM file, for the scripts."""

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian

from .gated_phantom import RR_MS

NM = "1.2.840.10008.5.1.4.1.1.20"
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def nm(path, voxels, affine, number, gates=1):
    """A reconstructed NM image of voxels[i, j, k], the same in all gates, or voxels[i, j, k, gate]; `affine` maps
    indices to LPS mm and has right angles."""
    steps = affine[:3, :3]
    spacing = np.linalg.norm(steps, axis=0)
    rows, columns = steps[:, 0] / spacing[0], steps[:, 1] / spacing[1]
    sign = np.sign(np.dot(np.cross(rows, columns), steps[:, 2]))
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
    kind = "RECON GATED TOMO" if gates > 1 else "RECON TOMO"
    data.ImageType = ["DERIVED", "PRIMARY", kind, "EMISSION"]
    data.Rows, data.Columns = voxels.shape[1], voxels.shape[0]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
    data.PixelSpacing = [float(f"{spacing[1]:.9g}"), float(f"{spacing[0]:.9g}")]
    data.SpacingBetweenSlices = float(f"{sign * spacing[2]:.9g}")
    data.SliceThickness = float(f"{spacing[2]:.9g}")
    slices = voxels.shape[2]
    order = np.arange(gates * slices)[::-1]  # the file's frames in another order than the slices
    data.NumberOfFrames = len(order)
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
    data.PixelData = frames.astype("<u2").tobytes()
    data["PixelData"].VR = "OW"
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = NM, data.SOPInstanceUID
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.file_meta = meta
    data.save_as(path, enforce_file_format=True)
