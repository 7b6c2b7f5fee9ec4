// Made of openapi/ventriform.json by `npm run types`. Do not edit.

export const FIGURES = {
  "BeatReport": [
    {
      "place": "ef_percent",
      "label": "Ejection fraction",
      "about": "Share of the end-diastolic volume that a beat ejects.",
      "unit": "%",
      "digits": 0,
      "short": "EF",
      "interval": "ef_interval_percent",
      "headline": true,
      "code": "70822001, SCT"
    },
    {
      "place": "edv_ml",
      "label": "End-diastolic volume",
      "about": "The largest volume of the cavity over the beat.",
      "unit": "ml",
      "digits": 0,
      "short": "EDV",
      "interval": "edv_interval_ml",
      "headline": true,
      "code": "8821-1, LN"
    },
    {
      "place": "esv_ml",
      "label": "End-systolic volume",
      "about": "The smallest volume of the cavity over the beat.",
      "unit": "ml",
      "digits": 0,
      "short": "ESV",
      "interval": "esv_interval_ml",
      "headline": true,
      "code": "8823-7, LN"
    },
    {
      "place": "sv_ml",
      "label": "Stroke volume",
      "about": "Volume that a beat ejects: end diastole less end systole.",
      "unit": "ml",
      "digits": 0,
      "headline": true,
      "code": "90096001, SCT"
    },
    {
      "place": "mass_g",
      "label": "Mass",
      "about": "Mass of the wall's muscle in the mean of the beat, at 1.05 g/ml.",
      "unit": "g",
      "digits": 0,
      "headline": true,
      "code": "122447, DCM"
    },
    {
      "place": "rates/peak_ejection_edv_per_s",
      "label": "Peak ejection rate",
      "about": "Greatest rate at which the cavity empties.",
      "unit": "EDV/s",
      "digits": 2,
      "headline": true,
      "code": "122616, DCM"
    },
    {
      "place": "rates/peak_filling_edv_per_s",
      "label": "Peak filling rate",
      "about": "Greatest rate at which the cavity fills.",
      "unit": "EDV/s",
      "digits": 2,
      "headline": true,
      "code": "122618, DCM"
    },
    {
      "place": "rates/time_to_peak_filling_ms",
      "label": "Time to peak filling",
      "about": "From end systole to the greatest rate of filling.",
      "unit": "ms",
      "digits": 0,
      "headline": true,
      "code": "PEAK-FILLING-MS, 99VENTRIFORM"
    },
    {
      "place": "rr_ms",
      "label": "R-R interval",
      "about": "Length of a beat, as given or as the file states it.",
      "unit": "ms",
      "digits": 0
    },
    {
      "place": "phase/mean_degrees",
      "label": "Mean phase",
      "about": "Circular mean of the phases of the wall's thickening.",
      "unit": "°",
      "digits": 0,
      "section": "Phases of the wall",
      "needs": "phase/reliable",
      "code": "PHASE-MEAN, 99VENTRIFORM"
    },
    {
      "place": "phase/sd_degrees",
      "label": "Standard deviation of the phases",
      "about": "Spread of the phases over the wall: of a heart that contracts at once it is small.",
      "unit": "°",
      "digits": 0,
      "section": "Phases of the wall",
      "needs": "phase/reliable",
      "headline": true,
      "code": "PHASE-SD, 99VENTRIFORM"
    },
    {
      "place": "phase/bandwidth_degrees",
      "label": "Bandwidth of the phases, 95 %",
      "about": "The smallest part of the cycle that holds 95 per cent of the wall's phases.",
      "unit": "°",
      "digits": 0,
      "section": "Phases of the wall",
      "needs": "phase/reliable",
      "headline": true,
      "code": "PHASE-BANDWIDTH, 99VENTRIFORM"
    },
    {
      "place": "phase/entropy_percent",
      "label": "Entropy of the phases",
      "about": "Entropy of the histogram of phases, in per cent of that of an even one.",
      "unit": "%",
      "digits": 0,
      "section": "Phases of the wall",
      "needs": "phase/reliable",
      "code": "PHASE-ENTROPY, 99VENTRIFORM"
    },
    {
      "place": "phase/noise_degrees",
      "label": "Scatter by noise alone",
      "about": "Standard deviation that the noise of the gates alone gives the phases.",
      "unit": "°",
      "digits": 0,
      "section": "Phases of the wall",
      "code": "PHASE-NOISE, 99VENTRIFORM"
    }
  ],
  "ComparedScan": [
    {
      "place": "cavity_ml",
      "label": "Cavity",
      "about": "Volume of the cavity in the image of all gates.",
      "unit": "ml",
      "digits": 0,
      "headline": true,
      "code": "CAVITY, 99VENTRIFORM"
    },
    {
      "place": "muscle_ml",
      "label": "Muscle",
      "about": "Volume of the wall's muscle in the image of all gates.",
      "unit": "ml",
      "digits": 0,
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "perfusion/extent_percent",
      "label": "Below the limit",
      "about": "Share of the wall below the normal limit.",
      "unit": "%",
      "digits": 0,
      "interval": "extent_interval_percent",
      "verdict": "extent_verdict",
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "polar/extent_percent",
      "label": "Below the threshold",
      "about": "Share of the wall below the threshold, a share of the scan's own maximum.",
      "unit": "%",
      "digits": 0,
      "unless": "perfusion",
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "perfusion/deficit_percent",
      "label": "Deficit score",
      "about": "Mean score of the wall, in per cent of the greatest.",
      "unit": "%",
      "digits": 1,
      "interval": "deficit_interval_percent",
      "verdict": "deficit_verdict",
      "headline": true,
      "code": "DEFICIT, 99VENTRIFORM"
    }
  ],
  "ComparedSegment": [
    {
      "place": "stress_percent",
      "label": "stress",
      "about": "Uptake at stress, scaled to rest.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "251053005, SCT"
    },
    {
      "place": "rest_percent",
      "label": "rest",
      "about": "Uptake at rest.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "251053005, SCT"
    },
    {
      "place": "difference_points",
      "label": "rest less stress",
      "about": "Uptake at rest less that at stress: positive where stress lacks uptake.",
      "unit": "points",
      "digits": 0,
      "signed": true,
      "headline": true,
      "code": "DIFFERENCE, 99VENTRIFORM"
    },
    {
      "place": "reversible_percent",
      "label": "reversible",
      "about": "Share of its compared area that loses uptake at stress.",
      "unit": "%",
      "digits": 0,
      "needs": "difference_points",
      "headline": true,
      "code": "REVERSIBLE, 99VENTRIFORM"
    },
    {
      "place": "fixed_percent",
      "label": "fixed",
      "about": "Share of its compared area below the threshold in both scans.",
      "unit": "%",
      "digits": 0,
      "needs": "difference_points"
    },
    {
      "place": "stress_score",
      "label": "score at stress",
      "about": "Score at stress, 0 normal to 4 absent.",
      "unit": "",
      "digits": 0,
      "headline": true,
      "code": "SCORE, 99VENTRIFORM"
    },
    {
      "place": "rest_score",
      "label": "score at rest",
      "about": "Score at rest, 0 normal to 4 absent.",
      "unit": "",
      "digits": 0,
      "headline": true,
      "code": "SCORE, 99VENTRIFORM"
    },
    {
      "place": "motion_change_mm",
      "label": "motion, change",
      "about": "Motion inward at stress less that at rest.",
      "unit": "mm",
      "digits": 1,
      "interval": "motion_change_interval_mm",
      "verdict": "motion_change_verdict",
      "signed": true,
      "headline": true
    },
    {
      "place": "thickening_change_points",
      "label": "thickening, change",
      "about": "Thickening at stress less that at rest.",
      "unit": "points",
      "digits": 0,
      "interval": "thickening_change_interval_points",
      "verdict": "thickening_change_verdict",
      "signed": true,
      "headline": true
    }
  ],
  "ComparedTerritory": [
    {
      "place": "stress_percent",
      "label": "stress",
      "about": "Uptake at stress, scaled to rest.",
      "unit": "%",
      "digits": 0,
      "headline": true
    },
    {
      "place": "rest_percent",
      "label": "rest",
      "about": "Uptake at rest.",
      "unit": "%",
      "digits": 0,
      "headline": true
    },
    {
      "place": "difference_points",
      "label": "rest less stress",
      "about": "Uptake at rest less that at stress: positive where stress lacks uptake.",
      "unit": "points",
      "digits": 0,
      "signed": true,
      "headline": true
    },
    {
      "place": "reversible_percent",
      "label": "reversible",
      "about": "Share of its compared area that loses uptake at stress.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "REVERSIBLE, 99VENTRIFORM"
    },
    {
      "place": "fixed_percent",
      "label": "fixed",
      "about": "Share of its compared area below the threshold in both scans.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "FIXED, 99VENTRIFORM"
    }
  ],
  "ComparisonReport": [
    {
      "place": "tid",
      "label": "TID, cavity at stress over that at rest",
      "about": "Transient ischaemic dilation: the ratio of the cavities in the images of all gates.",
      "unit": "",
      "digits": 2,
      "short": "TID",
      "interval": "tid_interval",
      "verdict": "tid_verdict",
      "headline": true,
      "code": "428832008, SCT"
    },
    {
      "place": "reversible_percent",
      "label": "Reversible",
      "about": "Share of the wall that loses uptake at stress, as far as half of the depth of the loss.",
      "unit": "%",
      "digits": 0,
      "short": "reversible",
      "interval": "reversible_interval_percent",
      "verdict": "reversible_verdict",
      "headline": true,
      "code": "REVERSIBLE, 99VENTRIFORM"
    },
    {
      "place": "fixed_percent",
      "label": "Fixed",
      "about": "Share of the wall below the threshold in both scans.",
      "unit": "%",
      "digits": 0,
      "short": "fixed",
      "interval": "fixed_interval_percent",
      "verdict": "fixed_verdict",
      "headline": true,
      "code": "FIXED, 99VENTRIFORM"
    },
    {
      "place": "reverse_percent",
      "label": "Reverse redistribution",
      "about": "Share of the wall that lacks uptake at rest beside stress.",
      "unit": "%",
      "digits": 0,
      "interval": "reverse_interval_percent",
      "verdict": "reverse_verdict",
      "code": "REVERSE, 99VENTRIFORM"
    },
    {
      "place": "lost_percent",
      "label": "Uptake lost at stress",
      "about": "What stress lacks in the regions that lose uptake, in per cent of the whole wall's uptake at rest.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "LOST, 99VENTRIFORM"
    },
    {
      "place": "detectable_percent",
      "label": "Least loss that would show",
      "about": "The least loss of a territory that is found in nine of ten pairs with this noise.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "DETECTABLE, 99VENTRIFORM"
    },
    {
      "place": "sss",
      "label": "SSS, summed stress score",
      "about": "Sum of the segments' scores at stress.",
      "unit": "of 68",
      "digits": 0,
      "short": "SSS",
      "interval": "sss_interval",
      "verdict": "sss_verdict",
      "headline": true,
      "code": "82648-7, LN"
    },
    {
      "place": "srs",
      "label": "SRS, summed rest score",
      "about": "Sum of the segments' scores at rest.",
      "unit": "of 68",
      "digits": 0,
      "short": "SRS",
      "interval": "srs_interval",
      "verdict": "srs_verdict",
      "headline": true,
      "code": "SRS, 99VENTRIFORM"
    },
    {
      "place": "sds",
      "label": "SDS, summed difference score",
      "about": "What the segments' scores at stress exceed those at rest by.",
      "unit": "of 68",
      "digits": 0,
      "short": "SDS",
      "interval": "sds_interval",
      "verdict": "sds_verdict",
      "headline": true,
      "code": "82644-6, LN"
    },
    {
      "place": "beat/stress_ef_percent",
      "label": "Ejection fraction at stress",
      "about": "Share of the end-diastolic volume that a beat ejects at stress.",
      "unit": "%",
      "digits": 0,
      "section": "The beat at stress and at rest",
      "headline": true,
      "code": "70822001, SCT"
    },
    {
      "place": "beat/rest_ef_percent",
      "label": "Ejection fraction at rest",
      "about": "Share of the end-diastolic volume that a beat ejects at rest.",
      "unit": "%",
      "digits": 0,
      "section": "The beat at stress and at rest",
      "headline": true,
      "code": "70822001, SCT"
    },
    {
      "place": "beat/ef_change_points",
      "label": "Change of the ejection fraction",
      "about": "Ejection fraction at stress less that at rest.",
      "unit": "points",
      "digits": 0,
      "short": "EF change",
      "section": "The beat at stress and at rest",
      "interval": "beat/ef_change_interval_points",
      "verdict": "beat/ef_change_verdict",
      "signed": true,
      "code": "EF-CHANGE, 99VENTRIFORM"
    },
    {
      "place": "beat/stress_edv_ml",
      "label": "End-diastolic volume at stress",
      "about": "The largest volume of the cavity over the beat at stress.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest"
    },
    {
      "place": "beat/rest_edv_ml",
      "label": "End-diastolic volume at rest",
      "about": "The largest volume of the cavity over the beat at rest.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest"
    },
    {
      "place": "beat/stress_esv_ml",
      "label": "End-systolic volume at stress",
      "about": "The smallest volume of the cavity over the beat at stress.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest"
    },
    {
      "place": "beat/rest_esv_ml",
      "label": "End-systolic volume at rest",
      "about": "The smallest volume of the cavity over the beat at rest.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest"
    },
    {
      "place": "beat/edv_change_ml",
      "label": "Change of the end-diastolic volume",
      "about": "End-diastolic volume at stress less that at rest.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest",
      "interval": "beat/edv_change_interval_ml",
      "verdict": "beat/edv_change_verdict",
      "signed": true
    },
    {
      "place": "beat/esv_change_ml",
      "label": "Change of the end-systolic volume",
      "about": "End-systolic volume at stress less that at rest.",
      "unit": "ml",
      "digits": 0,
      "section": "The beat at stress and at rest",
      "interval": "beat/esv_change_interval_ml",
      "verdict": "beat/esv_change_verdict",
      "signed": true
    },
    {
      "place": "compared_percent",
      "label": "Wall with muscle in both scans",
      "about": "Share of the wall that was compared.",
      "unit": "%",
      "digits": 0,
      "section": "How both scans were matched"
    },
    {
      "place": "matched_percent",
      "label": "Wall by which stress was scaled",
      "about": "Share of the wall that is taken for unchanged.",
      "unit": "%",
      "digits": 0,
      "section": "How both scans were matched"
    },
    {
      "place": "scale",
      "label": "Counts of stress for one at rest",
      "about": "Counts of the stress scan that are one count of the rest scan where nothing changed.",
      "unit": "",
      "digits": 2,
      "section": "How both scans were matched"
    },
    {
      "place": "reversible_points",
      "label": "Loss that counts as reversible",
      "about": "The least loss in smoothed maps that the noise of this pair does not explain.",
      "unit": "points",
      "digits": 0,
      "section": "How both scans were matched"
    },
    {
      "place": "noise_points",
      "label": "Noise of the difference",
      "about": "Standard deviation of the smoothed difference by the noise of both scans.",
      "unit": "points",
      "digits": 1,
      "section": "How both scans were matched",
      "code": "NOISE, 99VENTRIFORM"
    },
    {
      "place": "turn_degrees",
      "label": "Stress map turned by",
      "about": "How far the stress map is turned against the rest map.",
      "unit": "°",
      "digits": 0,
      "section": "How both scans were matched"
    },
    {
      "place": "correlation",
      "label": "Correlation of both maps",
      "about": "Correlation of uptake at stress and at rest over the wall.",
      "unit": "",
      "digits": 2,
      "section": "How both scans were matched"
    }
  ],
  "ModelReport": [
    {
      "place": "mesh/vertices",
      "label": "Points",
      "about": "Number of the mesh's vertices.",
      "unit": "",
      "digits": 0,
      "flat_name": "vertices",
      "headline": true
    },
    {
      "place": "mesh/triangles",
      "label": "Triangles",
      "about": "Number of the mesh's triangles.",
      "unit": "",
      "digits": 0,
      "flat_name": "triangles"
    },
    {
      "place": "distance/mean_mm",
      "label": "Distance to the surface, mean",
      "about": "Mean distance between the model and the image's surface.",
      "unit": "mm",
      "digits": 2,
      "flat_name": "distance_mean_mm",
      "headline": true
    },
    {
      "place": "distance/hausdorff_mm",
      "label": "Hausdorff distance",
      "about": "Largest distance between the model and the image's surface.",
      "unit": "mm",
      "digits": 2,
      "flat_name": "hausdorff_mm",
      "headline": true
    },
    {
      "place": "distance/hd95_mm",
      "label": "Hausdorff distance, 95 %",
      "about": "95th percentile of the distance between the model and the image's surface.",
      "unit": "mm",
      "digits": 2,
      "headline": true
    },
    {
      "place": "distance/volume_ml",
      "label": "Volume",
      "about": "Volume that the model encloses.",
      "unit": "ml",
      "digits": 1,
      "headline": true
    },
    {
      "place": "distance/volume_error_percent",
      "label": "Volume error",
      "about": "Volume that the model encloses beyond that of the surface, in per cent of it.",
      "unit": "%",
      "digits": 2,
      "flat_name": "volume_error_percent",
      "signed": true,
      "headline": true
    },
    {
      "place": "shape/radius_ratio/mean",
      "label": "Triangle shape 2r/R, mean",
      "about": "Twice the radius of the inscribed circle over that of the circumscribed one: 1 for equal sides.",
      "unit": "of 1",
      "digits": 3,
      "flat_name": "radius_ratio_mean",
      "headline": true
    },
    {
      "place": "shape/radius_ratio/min",
      "label": "Triangle shape 2r/R, least",
      "about": "The same of the worst triangle.",
      "unit": "of 1",
      "digits": 3,
      "flat_name": "radius_ratio_min",
      "headline": true
    },
    {
      "place": "smoothness/dihedral_deg/mean",
      "label": "Angle between neighbours, mean",
      "about": "Mean angle between the normals of neighbouring triangles.",
      "unit": "°",
      "digits": 1,
      "flat_name": "dihedral_mean_deg",
      "headline": true
    },
    {
      "place": "mesh/self_intersections",
      "label": "Self-intersections",
      "about": "Pairs of triangles that cut through each other.",
      "unit": "",
      "digits": 0,
      "flat_name": "self_intersections"
    },
    {
      "place": "fitness/gain_percent",
      "label": "Fitness gained by optimisation",
      "about": "How much edge flips raise the four-term fitness.",
      "unit": "%",
      "digits": 1,
      "signed": true,
      "headline": true
    },
    {
      "place": "timings_ms/total",
      "label": "Time from voxels to the measured model",
      "about": "Time of all stages.",
      "unit": "ms",
      "digits": 0,
      "headline": true
    }
  ],
  "Perfusion": [
    {
      "place": "extent_percent",
      "label": "Below the limit",
      "about": "Share of the wall whose uptake is below the normal limit.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "deficit_percent",
      "label": "Deficit score",
      "about": "Mean score of the wall, in per cent of the greatest; TPD-like, not comparable with QPS's.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "DEFICIT, 99VENTRIFORM"
    },
    {
      "place": "severity",
      "label": "Mean depth below the limit",
      "about": "How far the wall below the limit is from the normal mean.",
      "unit": "SD",
      "digits": 1,
      "headline": true,
      "code": "SEVERITY, 99VENTRIFORM"
    },
    {
      "place": "summed_score",
      "label": "Summed score",
      "about": "Sum of the scores of the 17 segments.",
      "unit": "of 68",
      "digits": 0,
      "headline": true,
      "code": "SUMMED-SCORE, 99VENTRIFORM"
    },
    {
      "place": "summed_percent",
      "label": "Summed score, relative",
      "about": "Sum of the scores of the 17 segments, in per cent of 68.",
      "unit": "%",
      "digits": 0
    }
  ],
  "PolarSegment": [
    {
      "place": "mean_percent",
      "label": "mean",
      "about": "Mean uptake, in per cent of the hottest quarter of this scan's own wall.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "251053005, SCT"
    },
    {
      "place": "extent_percent",
      "label": "below the threshold",
      "about": "Share of its area below the threshold.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "427751006, SCT"
    }
  ],
  "SegmentMotionReport": [
    {
      "place": "motion_mm",
      "label": "motion inward",
      "about": "Motion of the inner surface inward, end diastole to end systole.",
      "unit": "mm",
      "digits": 1,
      "headline": true,
      "code": "60797005, SCT"
    },
    {
      "place": "thickening_percent",
      "label": "thickening",
      "about": "Thickening of the wall, end diastole to end systole.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "59092-7, LN"
    },
    {
      "place": "thickening_counts_percent",
      "label": "by counts",
      "about": "Thickening by the counts of the wall: lower by what the image's filter takes.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "THICKENING-COUNT, 99VENTRIFORM"
    },
    {
      "place": "phase_degrees",
      "label": "phase",
      "about": "Phase of the greatest thickness.",
      "unit": "°",
      "digits": 0,
      "headline": true,
      "code": "PHASE, 99VENTRIFORM"
    }
  ],
  "SegmentScore": [
    {
      "place": "z",
      "label": "mean z",
      "about": "Standard deviations from the normal mean, negative below.",
      "unit": "",
      "digits": 1,
      "signed": true,
      "headline": true,
      "code": "Z, 99VENTRIFORM"
    },
    {
      "place": "score",
      "label": "score",
      "about": "Score, 0 normal to 4 absent.",
      "unit": "",
      "digits": 0,
      "headline": true,
      "code": "SCORE, 99VENTRIFORM"
    },
    {
      "place": "extent_percent",
      "label": "below the limit",
      "about": "Share of its area below the normal limit.",
      "unit": "%",
      "digits": 1,
      "needs": "z",
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "deficit_percent",
      "label": "deficit score",
      "about": "Mean score of its wall, in per cent of the greatest.",
      "unit": "%",
      "digits": 1,
      "needs": "z",
      "code": "DEFICIT, 99VENTRIFORM"
    }
  ],
  "SegmentationReport": [
    {
      "place": "volumes_ml/anatomical/cavity",
      "label": "Cavity",
      "about": "Volume of the cavity within the anatomical wall, which is the wall without the image's blur.",
      "unit": "ml",
      "digits": 0,
      "interval": "volumes_ml/anatomical_interval/cavity",
      "flat_name": "cavity_ml",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "volumes_ml/cavity",
      "label": "Cavity",
      "about": "Volume of the cavity within the wall that was asked for.",
      "unit": "ml",
      "digits": 0,
      "unless": "volumes_ml/anatomical",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "volumes_ml/anatomical/wall",
      "label": "Wall",
      "about": "Volume of the anatomical wall, which is the wall without the image's blur.",
      "unit": "ml",
      "digits": 0,
      "interval": "volumes_ml/anatomical_interval/wall",
      "flat_name": "wall_ml",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "volumes_ml/wall",
      "label": "Volume",
      "about": "Volume of the wall that was asked for, or of the organ.",
      "unit": "ml",
      "digits": 1,
      "unless": "volumes_ml/anatomical",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "mass_g",
      "label": "Mass",
      "about": "Mass of the anatomical wall's muscle, at 1.05 g/ml.",
      "unit": "g",
      "digits": 0,
      "interval": "mass_interval_g",
      "headline": true,
      "code": "118538004, SCT"
    },
    {
      "place": "thickness_mm/anatomical/mean",
      "label": "Thickness",
      "about": "Mean thickness of the anatomical wall.",
      "unit": "mm",
      "digits": 1,
      "interval": "thickness_mm/anatomical_interval",
      "headline": true,
      "code": "122445, DCM"
    },
    {
      "place": "wall_thickness_mm",
      "label": "Thickness",
      "about": "Mean thickness of the wall that was asked for.",
      "unit": "mm",
      "digits": 1,
      "unless": "thickness_mm",
      "headline": true,
      "code": "122445, DCM"
    },
    {
      "place": "polar/extent_percent",
      "label": "Below the threshold",
      "about": "Share of the wall whose uptake is below the threshold, a share of this scan's own maximum.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "volumes_ml/apparent/cavity",
      "label": "Cavity, apparent",
      "about": "Volume of the cavity within the apparent wall, which is the wall as the blurred image shows it.",
      "unit": "ml",
      "digits": 0,
      "section": "As the blurred image shows it",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "volumes_ml/apparent/wall",
      "label": "Wall, apparent",
      "about": "Volume of the apparent wall, which is the wall as the blurred image shows it.",
      "unit": "ml",
      "digits": 0,
      "section": "As the blurred image shows it",
      "headline": true,
      "code": "118565006, SCT"
    },
    {
      "place": "thickness_mm/apparent/mean",
      "label": "Thickness, apparent",
      "about": "Mean thickness of the apparent wall.",
      "unit": "mm",
      "digits": 1,
      "section": "As the blurred image shows it",
      "headline": true,
      "code": "122445, DCM"
    },
    {
      "place": "measures/jaccard",
      "label": "Jaccard index (E_J)",
      "about": "Overlap with the expert's mask: the shared part over the union.",
      "unit": "of 1",
      "digits": 3,
      "section": "Against the expert",
      "headline": true,
      "code": "JACCARD, 99VENTRIFORM"
    },
    {
      "place": "measures/dice",
      "label": "Dice index",
      "about": "Overlap with the expert's mask: twice the shared part over the sum.",
      "unit": "of 1",
      "digits": 3,
      "section": "Against the expert",
      "headline": true,
      "code": "DICE, 99VENTRIFORM"
    },
    {
      "place": "measures/contour_distance_voxels",
      "label": "Contour distance (E_CD)",
      "about": "Mean distance of the contours from the expert's, in voxels.",
      "unit": "voxels",
      "digits": 3,
      "section": "Against the expert",
      "headline": true
    },
    {
      "place": "measures/contour_distance_mm",
      "label": "Contour distance",
      "about": "Mean distance of the contours from the expert's.",
      "unit": "mm",
      "digits": 2,
      "section": "Against the expert",
      "code": "CONTOUR-MM, 99VENTRIFORM"
    },
    {
      "place": "measures/hausdorff_mm",
      "label": "Hausdorff distance",
      "about": "Largest distance of the contours from the expert's.",
      "unit": "mm",
      "digits": 2,
      "section": "Against the expert",
      "code": "HAUSDORFF-MM, 99VENTRIFORM"
    },
    {
      "place": "measures/hausdorff95_mm",
      "label": "Hausdorff distance, 95 %",
      "about": "95th percentile of the distance of the contours from the expert's.",
      "unit": "mm",
      "digits": 2,
      "section": "Against the expert",
      "headline": true
    },
    {
      "place": "measures/volume_ml",
      "label": "Volume of the mask",
      "about": "Volume of the mask that is compared.",
      "unit": "ml",
      "digits": 1,
      "section": "Against the expert"
    },
    {
      "place": "measures/expert_volume_ml",
      "label": "Volume of the expert's mask",
      "about": "Volume of the expert's mask.",
      "unit": "ml",
      "digits": 1,
      "section": "Against the expert"
    },
    {
      "place": "measures/volume_difference_ml",
      "label": "Volume difference",
      "about": "How much larger the mask is than the expert's.",
      "unit": "ml",
      "digits": 1,
      "section": "Against the expert",
      "signed": true
    },
    {
      "place": "measures/volume_difference_percent",
      "label": "Volume difference, relative",
      "about": "How much larger the mask is than the expert's, in per cent of the expert's.",
      "unit": "%",
      "digits": 1,
      "section": "Against the expert",
      "signed": true
    }
  ],
  "SerialPair": [
    {
      "place": "worse_percent",
      "label": "Worse",
      "about": "Share of the wall that lost uptake, as far as half of the depth of the loss.",
      "unit": "%",
      "digits": 0,
      "short": "worse",
      "interval": "worse_interval_percent",
      "verdict": "worse_verdict",
      "headline": true,
      "code": "WORSE, 99VENTRIFORM"
    },
    {
      "place": "better_percent",
      "label": "Better",
      "about": "Share of the wall that gained uptake.",
      "unit": "%",
      "digits": 0,
      "short": "better",
      "interval": "better_interval_percent",
      "verdict": "better_verdict",
      "headline": true,
      "code": "BETTER, 99VENTRIFORM"
    },
    {
      "place": "dark_in_both_percent",
      "label": "Below the threshold in both",
      "about": "Share of the wall below the threshold in both scans.",
      "unit": "%",
      "digits": 0,
      "headline": true
    },
    {
      "place": "lost_percent",
      "label": "Uptake lost",
      "about": "What the later scan lacks where uptake was lost, in per cent of the whole wall's uptake.",
      "unit": "%",
      "digits": 1,
      "headline": true
    },
    {
      "place": "detectable_percent",
      "label": "Least loss that would show",
      "about": "The least loss of a territory that is found in nine of ten pairs with this noise.",
      "unit": "%",
      "digits": 0,
      "headline": true
    }
  ],
  "SerialScan": [
    {
      "place": "ef_percent",
      "label": "Ejection fraction",
      "about": "Share of the end-diastolic volume that a beat ejects.",
      "unit": "%",
      "digits": 0,
      "short": "EF",
      "headline": true,
      "code": "70822001, SCT"
    },
    {
      "place": "edv_ml",
      "label": "End-diastolic volume",
      "about": "The largest volume of the cavity over the beat.",
      "unit": "ml",
      "digits": 0,
      "short": "EDV",
      "headline": true
    },
    {
      "place": "esv_ml",
      "label": "End-systolic volume",
      "about": "The smallest volume of the cavity over the beat.",
      "unit": "ml",
      "digits": 0,
      "short": "ESV",
      "headline": true
    },
    {
      "place": "cavity_ml",
      "label": "Cavity",
      "about": "Volume of the cavity in the image of all gates.",
      "unit": "ml",
      "digits": 0,
      "short": "cavity",
      "headline": true
    },
    {
      "place": "mass_g",
      "label": "Mass",
      "about": "Mass of the muscle by the fit of the scan alone; the volumes of all scans stand on one common mass.",
      "unit": "g",
      "digits": 0,
      "short": "mass",
      "headline": true
    },
    {
      "place": "dark_percent",
      "label": "Below the threshold",
      "about": "Share of the wall below the threshold, a share of the scan's own maximum.",
      "unit": "%",
      "digits": 0,
      "short": "below the threshold",
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "extent_percent",
      "label": "Below the limit",
      "about": "Share of the wall below the normal limit.",
      "unit": "%",
      "digits": 0,
      "short": "extent",
      "headline": true
    },
    {
      "place": "deficit_percent",
      "label": "Deficit score",
      "about": "Mean score of the wall, in per cent of the greatest.",
      "unit": "%",
      "digits": 1,
      "short": "deficit",
      "headline": true,
      "code": "DEFICIT, 99VENTRIFORM"
    },
    {
      "place": "summed_score",
      "label": "Summed score",
      "about": "Sum of the segments' scores.",
      "unit": "of 68",
      "digits": 0,
      "short": "summed score",
      "headline": true
    },
    {
      "place": "motion_mm",
      "label": "Motion",
      "about": "Inward motion from end diastole to end systole, the mean of the segments.",
      "unit": "mm",
      "digits": 1,
      "short": "motion",
      "headline": true
    },
    {
      "place": "thickening_percent",
      "label": "Thickening",
      "about": "Thickening from end diastole to end systole, the mean of the segments.",
      "unit": "%",
      "digits": 0,
      "short": "thickening",
      "headline": true
    },
    {
      "place": "phase_sd_degrees",
      "label": "Phase SD",
      "about": "Standard deviation of the phases of the wall.",
      "unit": "°",
      "digits": 0,
      "short": "phase SD",
      "headline": true
    },
    {
      "place": "phase_bandwidth_degrees",
      "label": "Phase bandwidth",
      "about": "Width of the range that holds 95 % of the phases.",
      "unit": "°",
      "digits": 0,
      "short": "phase bandwidth",
      "headline": true
    }
  ],
  "SerialSegment": [
    {
      "place": "earlier_percent",
      "label": "earlier",
      "about": "Mean uptake in the earlier scan.",
      "unit": "%",
      "digits": 0,
      "headline": true,
      "code": "251053005, SCT"
    },
    {
      "place": "later_percent",
      "label": "later",
      "about": "Mean uptake in the later scan, scaled to the earlier one.",
      "unit": "%",
      "digits": 0,
      "headline": true
    },
    {
      "place": "change_points",
      "label": "change",
      "about": "Uptake in the later scan less that in the earlier one.",
      "unit": "points",
      "digits": 0,
      "verdict": "change_verdict",
      "signed": true,
      "headline": true
    },
    {
      "place": "motion_change_mm",
      "label": "motion, change",
      "about": "Inward motion in the later scan less that in the earlier one.",
      "unit": "mm",
      "digits": 1,
      "signed": true,
      "headline": true
    },
    {
      "place": "thickening_change_points",
      "label": "thickening, change",
      "about": "Thickening in the later scan less that in the earlier one.",
      "unit": "points",
      "digits": 0,
      "signed": true,
      "headline": true
    }
  ],
  "TerritoryScore": [
    {
      "place": "extent_percent",
      "label": "below the limit",
      "about": "Share of its wall below the normal limit.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "427751006, SCT"
    },
    {
      "place": "deficit_percent",
      "label": "deficit score",
      "about": "Mean score of its wall, in per cent of the greatest.",
      "unit": "%",
      "digits": 1,
      "headline": true,
      "code": "DEFICIT, 99VENTRIFORM"
    },
    {
      "place": "summed_score",
      "label": "summed score",
      "about": "Sum of its segments' scores.",
      "unit": "",
      "digits": 0,
      "headline": true,
      "code": "SUMMED-SCORE, 99VENTRIFORM"
    }
  ]
};
