// Made of openapi/ventriform.json by `npm run types`. Do not edit.

export type paths = Record<string, never>;
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /** @description A mask against an expert's. */
        Agreement: {
            /**
             * Format: double
             * @description The same in mm.
             */
            contour_distance_mm?: number | null;
            /**
             * Format: double
             * @description Mean contour distance, voxels.
             */
            contour_distance_voxels?: number | null;
            /**
             * Format: double
             * @description Dice index.
             */
            dice: number;
            /**
             * Format: double
             * @description Volume of the expert's mask.
             */
            expert_volume_ml: number;
            /**
             * Format: double
             * @description Its 95th percentile.
             */
            hausdorff95_mm?: number | null;
            /**
             * Format: double
             * @description Hausdorff distance.
             */
            hausdorff_mm?: number | null;
            /**
             * Format: double
             * @description Jaccard index.
             */
            jaccard: number;
            /**
             * Format: double
             * @description How much larger the mask is, ml.
             */
            volume_difference_ml: number;
            /**
             * Format: double
             * @description How much larger the mask is, percent.
             */
            volume_difference_percent?: number | null;
            /**
             * Format: double
             * @description Volume of the mask.
             */
            volume_ml: number;
        };
        /** @description The reader's profile that a wall was drawn by. */
        AppliedReader: {
            /** @description The wall that was drawn from. */
            edge: string;
            /**
             * @description `edge`: by distances from the edge that the image shows. `level`: where the image has a share of the polar map's
             *     reference.
             */
            kind: string;
            /**
             * Format: double
             * @description The level, a share of the polar map's reference; `null` for a reader of kind `edge`.
             */
            level?: number | null;
            /**
             * Format: int64
             * @description Number of masks that it was learnt on.
             */
            masks: number;
            /** @description Its name. */
            name: string;
            offsets_mm?: components["schemas"]["ReaderOffsets"] | null;
            /** @description SHA-256 of the profile, hexadecimal. */
            sha256: string;
            /**
             * Format: double
             * @description Share of the movement that was applied: 1 unless the surface would intersect itself.
             */
            share_applied: number;
        };
        /** @description Which AuditEvent records an act. */
        AuditEventName: {
            /** @description Its hash, which the hashes of all later events cover. */
            hash: string;
            /**
             * @description Its id, as `GET /v1/audit` shows it.
             * @example 1234
             */
            id: string;
        };
        /** @description A page of the audit trail. */
        AuditPage: {
            /** @description The events, newest first: AuditEvent resources of FHIR R4. */
            events: Record<string, never>[];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /** @description A beat: one wall in motion, fitted to the gates of a volume, with its main figures. */
        Beat: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example bea_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["BeatLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["BeatParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description Volumes, ejection fraction, the spread of phases, the confidence of the fit to the gates' sum, and flags; the report has all figures. */
            summary: components["schemas"]["BeatSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        /** @description What changed of the beat from rest to stress. */
        BeatChange: {
            /** @description Its interval. */
            edv_change_interval_ml?: number[] | null;
            /**
             * Format: double
             * @description Change of the end-diastolic volume from rest to stress.
             */
            edv_change_ml?: number | null;
            edv_change_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Its interval. */
            ef_change_interval_points?: number[] | null;
            /**
             * Format: double
             * @description Change from rest to stress, points.
             */
            ef_change_points?: number | null;
            ef_change_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Its interval. */
            esv_change_interval_ml?: number[] | null;
            /**
             * Format: double
             * @description Change of the end-systolic volume.
             */
            esv_change_ml?: number | null;
            esv_change_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: double
             * @description End-diastolic volume at rest.
             */
            rest_edv_ml: number;
            /**
             * Format: double
             * @description Ejection fraction at rest.
             */
            rest_ef_percent?: number | null;
            /**
             * Format: double
             * @description End-systolic volume at rest.
             */
            rest_esv_ml: number;
            /**
             * Format: double
             * @description End-diastolic volume at stress, ml.
             */
            stress_edv_ml: number;
            /**
             * Format: double
             * @description Ejection fraction at stress, per cent; `null` if the gates are no beat.
             */
            stress_ef_percent?: number | null;
            /**
             * Format: double
             * @description End-systolic volume at stress.
             */
            stress_esv_ml: number;
        };
        BeatFileName: ("mesh_ed.glb" | "mesh_ed.gltf" | "mesh_ed.stl" | "mesh_ed.ply" | "mesh_ed.obj" | "mesh_ed.vtp" | "mesh_ed.vtk" | "mesh_ed.json" | "mesh_es.glb" | "mesh_es.gltf" | "mesh_es.stl" | "mesh_es.ply" | "mesh_es.obj" | "mesh_es.vtp" | "mesh_es.vtk" | "mesh_es.json" | "beat.json" | "report.html" | "curve.svg" | "phase.svg" | "gates.csv" | "segments.csv" | "polar.svg" | "polar.json" | "polar_ed.svg" | "polar_ed.json" | "polar_es.svg" | "polar_es.json" | "polar_motion.svg" | "polar_motion.json" | "polar_thickening.svg" | "polar_thickening.json" | "polar_phase.svg" | "polar_phase.json" | "polar_z.svg" | "polar_z.png" | "polar_z.json" | "polar_score.svg" | "polar_score.png" | "polar_score.json" | "mesh.glb" | "mask_ed.dcm" | "mask_es.dcm" | "measurements.dcm" | "fhir.json") | string;
        BeatJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "beat";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["BeatParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("mask_ed.dcm" | "mask_es.dcm" | "measurements.dcm")[];
            source?: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one beat. */
        BeatLinks: {
            /** @description The volume curve. */
            curve: string;
            /** @description DICOM objects of the scan's patient and study, for the archive. */
            dicom: string[];
            /** @description The wall at end diastole, in the format that `Accept` asks for. */
            mesh: string;
            /** @description The report as an HTML page. */
            page: string;
            /** @description The histogram of the wall's phases. */
            phase: string;
            /** @description The report. */
            report: string;
            /** @description This beat. */
            self: string;
            /** @description The volume. */
            volume: string;
        };
        /** @description A page of beats. */
        BeatList: {
            /** @description The beats, newest first. */
            beats: components["schemas"]["Beat"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /** @description The parameters of a beat */
        BeatParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description Whether the scan's attenuation was corrected, which chooses the group of the normal limits. Default: what a DICOM header says
             * @enum {string}
             */
            attenuation_corrected?: "yes" | "no";
            /** @description Direction from base to apex, x,y,z in LPS, of any length: the search stays within 35 degrees of it */
            axis?: number[];
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /** @description A point of the ventricle's base, x,y,z in LPS millimetres: the rim of the wall is put there (moved by at most 20 mm towards the apex or 40 mm away from it). Default: where image and anatomy put it */
            base?: number[];
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /** @description Box of voxels that contains the centre of the organ: i0,j0,k0,i1,j1,k1, counted from 0, both corners included */
            box?: number[];
            /** @description A point in the cavity, x,y,z in LPS millimetres: the search stays within 25 mm of it and does not question it. Default: the organ is searched for in the whole volume */
            center?: number[];
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /**
             * @description Whether the volumes of the file are gates of one heart beat although its header says otherwise
             * @default false
             */
            gated?: boolean;
            /**
             * @description Name (as in a report) of the fitted model to keep: a correction by the position, the axis or the base then keeps its heart. Default: the one with the greatest confidence
             * @example built-in usual
             */
            kept_model?: string;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Id of the model to fit (a template, a model or an earlier segmentation), or auto: fits the built-in hearts, the templates flagged `library` and the models named after it (auto,tpl_12,mdl_34), and keeps the fit with the greatest confidence. Alternative name: template
             * @default auto
             */
            model?: string;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /** @description Id of normal limits to compare the wall's uptake with */
            normals?: string;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description The scan's protocol, as the normal limits name it. Default: the only one that they have
             * @example rest
             */
            protocol?: string;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /** @description The R-R interval, ms, from which rates of ejection and filling are computed. Default: as the file states it */
            rr_ms?: number;
            /** @description Voxel i,j,k (counted from 0) in the cavity; use this or center */
            seed_point?: number[];
            /** @description Direction from the long axis to the wall that segments are counted from as the anterior one, x,y,z in the LPS frame of the volume, once the fit is done: heart and wall stay, names of places change. Default: the anterior wall by `superior` or `anterior`, which the fit starts from */
            segments_from?: number[];
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description The patient's sex, which chooses the group of the normal limits. Default: that of a DICOM header
             * @enum {string}
             */
            sex?: "F" | "M";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
            /**
             * @description The scan's tracer, as the normal limits name it. Default: the one that a DICOM header's text names, or the only one that they have
             * @example Tc-99m tetrofosmin
             */
            tracer?: string;
        };
        /** @description The report of a beat. Volumes are millilitres, lengths millimetres, angles degrees of the cycle. */
        BeatReport: {
            /**
             * Format: double
             * @description Confidence of the fit to the gates' sum, 0..=1.
             */
            confidence: number;
            /** @description The volume curve, gates' width taken off, at equal steps from the beginning of the first gate. */
            curve: components["schemas"]["CurvePoint"][];
            /** @description Interval about EDV that holds the true volume of nine of ten hearts; `null` if the gates are no beat. */
            edv_interval_ml?: number[] | null;
            /**
             * Format: double
             * @description End-diastolic volume: the largest of the curve.
             */
            edv_ml: number;
            /** @description The same about EF; `null` if there is none. */
            ef_interval_percent?: number[] | null;
            /**
             * Format: double
             * @description Ejection fraction of the largest and the smallest gate, per cent: a gate is a mean over its width.
             */
            ef_of_gates_percent?: number | null;
            /**
             * Format: double
             * @description Ejection fraction, per cent; `null` if the gates are no beat (flag `no_contraction`).
             */
            ef_percent?: number | null;
            /**
             * Format: double
             * @description When the curve is largest, degrees.
             */
            end_diastole_degrees: number;
            /**
             * Format: int64
             * @description The gate with the largest cavity.
             */
            end_diastole_gate: number;
            /**
             * Format: double
             * @description When the curve is smallest, degrees.
             */
            end_systole_degrees: number;
            /**
             * Format: int64
             * @description The gate with the smallest cavity.
             */
            end_systole_gate: number;
            /** @description The same about ESV. */
            esv_interval_ml?: number[] | null;
            /**
             * Format: double
             * @description End-systolic volume: the smallest of the curve.
             */
            esv_ml: number;
            /** @description Reasons to look closer: of the fit to the gates' sum, of what the file and the caller say, then of the beat. */
            flags: components["schemas"]["Flag"][];
            /** @description Each gate, in the mean over its width. */
            gates: components["schemas"]["GateReport"][];
            /** @description Sentences that a reader may take over into the impression; `null` where the report was made before they existed. */
            impression?: string[] | null;
            /** @description The file of the gates. */
            input: components["schemas"]["FileFacts"];
            long_axis?: components["schemas"]["LongAxis"] | null;
            /**
             * Format: double
             * @description Its mass, grams, at the density of muscle, 1.05 g/ml.
             */
            mass_g: number;
            /** @description Why there are no rates. */
            no_rates?: string | null;
            /** @description Every parameter, defaults written out. */
            parameters: {
                [key: string]: unknown;
            };
            perfusion?: components["schemas"]["Perfusion"] | null;
            /** @description Phases of the wall. */
            phase: components["schemas"]["PhaseReport"];
            posture?: components["schemas"]["Posture"] | null;
            rates?: components["schemas"]["RatesReport"] | null;
            resolution_mm?: components["schemas"]["Resolution"] | null;
            /**
             * Format: double
             * @description The R-R interval, ms, as given or stated by the file.
             */
            rr_ms?: number | null;
            /** @description The wall's segments (AHA). */
            segments: components["schemas"]["SegmentMotionReport"][];
            /**
             * Format: int64
             * @description Steps of the joint fit.
             */
            steps: number;
            /**
             * Format: double
             * @description Stroke volume; `null` if the gates are no beat.
             */
            sv_ml?: number | null;
            /** @description The model that was fitted to the gates' sum. */
            template: string;
            /** @description What the file says of the beats. */
            timing: components["schemas"]["TimingReport"];
            /**
             * Format: double
             * @description Muscle of the wall in the mean of the beat.
             */
            wall_ml: number;
            /**
             * Format: double
             * @description Its greatest change over the beat, per cent.
             */
            wall_swing_percent: number;
            /** @description Warnings about the files. */
            warnings: string[];
        };
        /** @description The main figures of a beat; the report has all. */
        BeatSummary: {
            /**
             * Format: double
             * @description Confidence of that fit, 0 to 1.
             */
            confidence: number;
            /**
             * Format: double
             * @description End-diastolic volume.
             */
            edv_ml: number;
            /**
             * Format: double
             * @description Ejection fraction; `null` if the gates are no beat.
             */
            ef_percent?: number | null;
            /**
             * Format: int64
             * @description The gate with the largest cavity, counted from 1.
             */
            end_diastole_gate: number;
            /**
             * Format: int64
             * @description The gate with the smallest cavity.
             */
            end_systole_gate: number;
            /**
             * Format: double
             * @description End-systolic volume.
             */
            esv_ml: number;
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /**
             * Format: int64
             * @description Number of gates.
             */
            gates: number;
            /**
             * Format: double
             * @description The smallest arc that holds 95 per cent of them, degrees.
             */
            phase_bandwidth_degrees: number;
            /** @description Whether the phases can be relied on. */
            phase_reliable: boolean;
            /**
             * Format: double
             * @description Standard deviation of the wall's phases, degrees.
             */
            phase_sd_degrees: number;
            /**
             * Format: double
             * @description Stroke volume.
             */
            sv_ml?: number | null;
            /** @description Name of the model that was fitted to the gates' sum. */
            template: string;
        };
        /** @description One model's fit. */
        Candidate: {
            /**
             * Format: double
             * @description Share of the surface along which an edge is seen.
             */
            active: number;
            /**
             * Format: double
             * @description Its confidence by its own figures, by which templates are ranked.
             */
            confidence: number;
            /**
             * Format: double
             * @description Figure that decides between equals.
             */
            merit: number;
            /**
             * Format: double
             * @description Distance to the edges, weighted root mean square.
             */
            residual_mm: number;
            /**
             * Format: double
             * @description Root of the mean squared strain.
             */
            strain: number;
            /** @description The model's name. */
            template: string;
        };
        /** @description Signed distances from a model to its surface, as in `distance.json`. */
        Closeness: {
            /**
             * @description Distance of the centroid of each part, mm, rounded to 0.001; positive outside of the
             *     surface. Triangle by triangle, `parts`² each.
             */
            distances_mm: number[];
            /**
             * Format: int64
             * @description Parts that each side of a triangle is cut into.
             */
            parts: number;
        };
        /** @description A row of a cohort's table whose scan a service stores. */
        CohortCase: {
            /** @description Whether attenuation was corrected. */
            attenuation_corrected: boolean;
            /**
             * @description Its name, once in the table; not a person's, as the limits repeat it.
             * @example n01
             */
            case: string;
            /**
             * @description Whether the person is healthy. Others are left out, unless they are the scan at rest of a healthy one.
             * @default true
             */
            healthy?: boolean;
            /**
             * @description Kind of stress or rest, camera and filter, in words: people of one group have the same.
             * @example rest
             */
            protocol: string;
            /** @description Of a scan at stress, the case that is the same person at rest. */
            rest_case?: string | null;
            /** @description The person's sex. */
            sex: components["schemas"]["Sex"];
            /**
             * @description The tracer; `simulated` in it marks the limits as simulated.
             * @example Tc-99m tetrofosmin
             */
            tracer: string;
            /** @description Id of the volume; gates of one beat for figures of beats. */
            volume: string;
        };
        CohortRequest: {
            /** @description The scans of the cohort, and what is known of each */
            cases: components["schemas"]["CohortCase"][];
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            /** @description The name of the limits; not a person's */
            name?: string;
            parameters?: components["schemas"]["NormalsFitParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description One of both scans. */
        ComparedScan: {
            /** @description Whether attenuation was corrected; `null` where the header does not say. */
            attenuation_corrected?: boolean | null;
            /**
             * Format: double
             * @description Volume of the cavity of the anatomical wall.
             */
            cavity_ml: number;
            /**
             * Format: double
             * @description Confidence of the fit, 0..=1.
             */
            confidence: number;
            /** @description The interval of the deficit score. */
            deficit_interval_percent?: number[] | null;
            deficit_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * @description The interval of the share below the limit by noise, 5th and 95th percentile; `null` unless both scans have limits,
             *     as for the others.
             */
            extent_interval_percent?: number[] | null;
            extent_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Total dose by the header, MBq. */
            injected_dose?: string | null;
            /** @description The file. */
            input: components["schemas"]["FileFacts"];
            long_axis?: components["schemas"]["LongAxis"] | null;
            /**
             * Format: double
             * @description Volume of the anatomical wall's muscle.
             */
            muscle_ml: number;
            perfusion?: components["schemas"]["Perfusion"] | null;
            polar?: components["schemas"]["PolarSummary"] | null;
            posture?: components["schemas"]["Posture"] | null;
            /** @description The tracer, if the header names one. */
            radiopharmaceutical?: string | null;
            resolution_mm?: components["schemas"]["Resolution"] | null;
            /** @description Series Description, if the header has one. */
            series_description?: string | null;
            /** @description The model that was fitted. */
            template: string;
            /** @description Warnings about the file. */
            warnings: string[];
        };
        /** @description A segment at stress and at rest. */
        ComparedSegment: components["schemas"]["UptakeChange"] & {
            /** @description Interval of that change: in nine of ten pairs such intervals hold all 17 changes together. */
            motion_change_interval_mm?: number[] | null;
            /**
             * Format: double
             * @description Change of motion from rest to stress, mm; `null` unless both scans are gated.
             */
            motion_change_mm?: number | null;
            motion_change_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Its name. */
            name: string;
            /**
             * Format: int32
             * @description Score at rest.
             */
            rest_score?: number | null;
            /**
             * Format: int64
             * @description Its number, 1 to 17.
             */
            segment: number;
            /**
             * Format: int32
             * @description Score at stress, 0 to 4.
             */
            stress_score?: number | null;
            /** @description Its interval, likewise. */
            thickening_change_interval_points?: number[] | null;
            /**
             * Format: double
             * @description Change of thickening from rest to stress, points.
             */
            thickening_change_points?: number | null;
            thickening_change_verdict?: components["schemas"]["Verdict"] | null;
        };
        /** @description The wall of an artery at stress and at rest. */
        ComparedTerritory: components["schemas"]["UptakeChange"] & {
            /** @description LAD, LCX or RCA. */
            name: string;
        };
        /**
         * @description A comparison: two scans of one patient, fitted by one model, with the main figures. Its volume is the scan at
         *     stress, its parameter `rest` the one at rest.
         */
        Comparison: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example cmp_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["ComparisonLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["ComparisonParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description Ratio of the cavities, summed scores, what is reversible and what fixed, and flags; the report has all figures. */
            summary: components["schemas"]["ComparisonSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        /** @enum {string} */
        ComparisonFileName: "mesh_stress.glb" | "mesh_stress.gltf" | "mesh_stress.stl" | "mesh_stress.ply" | "mesh_stress.obj" | "mesh_stress.vtp" | "mesh_stress.vtk" | "mesh_stress.json" | "mesh_rest.glb" | "mesh_rest.gltf" | "mesh_rest.stl" | "mesh_rest.ply" | "mesh_rest.obj" | "mesh_rest.vtp" | "mesh_rest.vtk" | "mesh_rest.json" | "comparison.json" | "report.html" | "slices.png" | "segments.csv" | "polar_stress.svg" | "polar_stress.png" | "polar_stress.json" | "polar_rest.svg" | "polar_rest.png" | "polar_rest.json" | "polar_difference.svg" | "polar_difference.png" | "polar_difference.json" | "polar_z_stress.svg" | "polar_z_stress.png" | "polar_z_stress.json" | "polar_z_rest.svg" | "polar_z_rest.png" | "polar_z_rest.json" | "polar_score_stress.svg" | "polar_score_stress.png" | "polar_score_stress.json" | "polar_score_rest.svg" | "polar_score_rest.png" | "polar_score_rest.json" | "region_stress.nii.gz" | "region_rest.nii.gz" | "measurements.dcm" | "page.dcm" | "polar_stress.dcm" | "polar_rest.dcm" | "polar_difference.dcm" | "fhir.json";
        ComparisonForm: {
            /**
             * Format: binary
             * @description The scan at rest; several files make up one
             */
            rest?: string;
            /**
             * Format: binary
             * @description The scan at stress; several files make up one
             */
            stress: string;
        };
        ComparisonJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "comparison";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["ComparisonParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("measurements.dcm" | "page.dcm" | "polar_stress.dcm" | "polar_rest.dcm" | "polar_difference.dcm")[];
            source?: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one comparison. */
        ComparisonLinks: {
            /** @description DICOM objects of the study of the scan at stress, for the archive. */
            dicom: string[];
            /** @description The wall at stress, in the format that `Accept` asks for. */
            mesh: string;
            /** @description The report as an HTML page. */
            page: string;
            /** @description The report. */
            report: string;
            /** @description The volume at rest. */
            rest: string;
            /** @description This comparison. */
            self: string;
            /** @description Slices of stress above those of rest. */
            slices: string;
            /** @description The volume at stress. */
            stress: string;
        };
        /** @description A page of comparisons. */
        ComparisonList: {
            /** @description The comparisons, newest first. */
            comparisons: components["schemas"]["Comparison"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /** @description The parameters of a comparison */
        ComparisonParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description Whether the scan's attenuation was corrected, which chooses the group of the normal limits. Default: what a DICOM header says
             * @enum {string}
             */
            attenuation_corrected?: "yes" | "no";
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /**
             * @description Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) or anatomical (the wall itself, without the thickness that blur adds). The report has the volumes of both
             * @default apparent
             * @enum {string}
             */
            edge?: "apparent" | "anatomical";
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /**
             * @description Whether the volumes of both files are gates of one heart beat although their headers say otherwise
             * @default false
             */
            gated?: boolean;
            /**
             * @description Name (as in a report) of the fitted model to keep: a correction by the position, the axis or the base then keeps its heart. Default: the one with the greatest confidence
             * @example built-in usual
             */
            kept_model?: string;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Id of the model to fit (a template, a model or an earlier segmentation), or auto: fits the built-in hearts, the templates flagged `library` and the models named after it (auto,tpl_12,mdl_34), and keeps the fit with the greatest confidence. Alternative name: template
             * @default auto
             */
            model?: string;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /** @description Id of normal limits to compare the wall's uptake with */
            normals?: string;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /** @description Id of the volume with the scan at rest */
            rest?: string;
            /** @description Direction from base to apex in the scan at rest, x,y,z in LPS, of any length: the search stays within 35 degrees of it */
            rest_axis?: number[];
            /** @description A point of the ventricle's base in the scan at rest, x,y,z in LPS millimetres: the rim of the wall is put there. Default: where image and anatomy put it */
            rest_base?: number[];
            /** @description A point in the cavity in the scan at rest, x,y,z in LPS millimetres: the search stays within 25 mm of it. Default: the heart is searched for */
            rest_center?: number[];
            /** @description Points that the wall's inner surface passes through in the scan at rest, x,y,z in LPS millimetres */
            rest_inner_through?: number[];
            /** @description Points that the wall's outer surface passes through in the scan at rest */
            rest_outer_through?: number[];
            /**
             * @description The protocol of the scan at rest. Default: the only one with the word rest in its name
             * @example rest
             */
            rest_protocol?: string;
            /** @description Direction from the long axis to the wall that segments are counted from in the scan at rest, x,y,z in LPS. Default: the anterior wall */
            rest_segments_from?: number[];
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /**
             * @description Whether both scans are of one patient although their headers name two, as after pseudonymisation
             * @default false
             */
            same_patient?: boolean;
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description The patient's sex, which chooses the group of the normal limits. Default: that of a DICOM header
             * @enum {string}
             */
            sex?: "F" | "M";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /** @description Direction from base to apex in the scan at stress, x,y,z in LPS, of any length: the search stays within 35 degrees of it */
            stress_axis?: number[];
            /** @description A point of the ventricle's base in the scan at stress, x,y,z in LPS millimetres: the rim of the wall is put there. Default: where image and anatomy put it */
            stress_base?: number[];
            /** @description A point in the cavity in the scan at stress, x,y,z in LPS millimetres: the search stays within 25 mm of it. Default: the heart is searched for */
            stress_center?: number[];
            /** @description Points that the wall's inner surface passes through in the scan at stress, x,y,z in LPS millimetres */
            stress_inner_through?: number[];
            /** @description Points that the wall's outer surface passes through in the scan at stress */
            stress_outer_through?: number[];
            /**
             * @description The protocol of the scan at stress, as the normal limits name it. Default: the only one with the word stress in its name
             * @example stress
             */
            stress_protocol?: string;
            /** @description Direction from the long axis to the wall that segments are counted from in the scan at stress, x,y,z in LPS. Default: the anterior wall */
            stress_segments_from?: number[];
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
            /**
             * @description The scan's tracer, as the normal limits name it. Default: the one that a DICOM header's text names, or the only one that they have
             * @example Tc-99m tetrofosmin
             */
            tracer?: string;
        };
        /**
         * @description The report of a comparison of rest and stress. Intervals, verdicts and what is known of the noise are `null` where it
         *     was made before they existed.
         */
        ComparisonReport: {
            beat?: components["schemas"]["BeatChange"] | null;
            /**
             * Format: double
             * @description Share of the wall with muscle in both scans.
             */
            compared_percent: number;
            /**
             * Format: double
             * @description Correlation of both maps.
             */
            correlation: number;
            /**
             * Format: double
             * @description The least loss, per cent of the uptake at rest, that is found in nine of ten such pairs if it takes up a territory.
             */
            detectable_percent?: number | null;
            /** @description Its interval. */
            fixed_interval_percent?: number[] | null;
            /**
             * Format: double
             * @description Share of the wall below the threshold in both scans.
             */
            fixed_percent: number;
            fixed_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /** @description Sentences that a reader may take over into the impression; `null` where the report was made before they existed. */
            impression?: string[] | null;
            /**
             * Format: double
             * @description What stress lacks in the regions that lose uptake, per cent of the whole wall's uptake at rest.
             */
            lost_percent?: number | null;
            /**
             * Format: double
             * @description Share of the wall by which stress was scaled.
             */
            matched_percent: number;
            /**
             * @description Why no beats were compared (`beat` is `null`), or no ejection fractions (`beat.ef_change_points` is `null`): one entry for each scan
             *     that is a reason. Empty where they were.
             */
            no_beat: components["schemas"]["NoBeat"][];
            /**
             * Format: double
             * @description Standard deviation of the smoothed difference by the noise of this pair, points.
             */
            noise_points?: number | null;
            /** @description Every parameter, defaults written out. */
            parameters: {
                [key: string]: unknown;
            };
            /** @description The scan at rest. */
            rest: components["schemas"]["ComparedScan"];
            /** @description Its interval. */
            reverse_interval_percent?: number[] | null;
            /**
             * Format: double
             * @description Share of the wall that lacks uptake at rest beside stress (reverse redistribution).
             */
            reverse_percent?: number | null;
            reverse_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Its interval by noise: 5th and 95th percentile, as for the others. */
            reversible_interval_percent?: number[] | null;
            /**
             * Format: double
             * @description Share of the wall that loses uptake at stress, each region as far as half of the depth of its loss.
             */
            reversible_percent: number;
            /**
             * Format: double
             * @description Loss of uptake that noise does not explain, points: a region has to lose more somewhere to count.
             */
            reversible_points: number;
            reversible_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: double
             * @description Counts of the stress scan that are one count of the rest scan where nothing changed.
             */
            scale: number;
            /**
             * Format: int32
             * @description Summed difference score: what the segments' scores at stress exceed those at rest by.
             */
            sds?: number | null;
            /** @description Its interval by noise, 5th and 95th percentile. */
            sds_interval?: number[] | null;
            sds_verdict?: components["schemas"]["Verdict"] | null;
            /** @description The 17 segments. */
            segments: components["schemas"]["ComparedSegment"][];
            /**
             * Format: int32
             * @description Summed rest score.
             */
            srs?: number | null;
            /** @description Its interval by noise, 5th and 95th percentile. */
            srs_interval?: number[] | null;
            srs_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: int32
             * @description Summed stress score, 0 to 68; `null` without normal limits, as for all scores.
             */
            sss?: number | null;
            /** @description Its interval by noise, 5th and 95th percentile. */
            sss_interval?: number[] | null;
            sss_verdict?: components["schemas"]["Verdict"] | null;
            /** @description The scan at stress. */
            stress: components["schemas"]["ComparedScan"];
            /** @description The summed scores in per cent of 68, in that order. */
            summed_percent?: number[] | null;
            /** @description The walls of the three arteries; none if the orientation is unknown. */
            territories: components["schemas"]["ComparedTerritory"][];
            /**
             * Format: double
             * @description Ratio of the cavities of the anatomical walls, stress to rest (transient ischaemic dilation), in the images of all gates.
             */
            tid: number;
            /** @description The interval of TID: that of an unchanged heart holds 1 in nine of ten pairs. */
            tid_interval?: number[] | null;
            tid_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: double
             * @description How far the stress map is turned against the rest map, degrees.
             */
            turn_degrees: number;
        };
        ComparisonRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            /** @description Normal limits by which both scans are scored */
            normals?: string;
            parameters?: components["schemas"]["ComparisonParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description The scan at rest */
            rest: string;
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("measurements.dcm" | "page.dcm" | "polar_stress.dcm" | "polar_rest.dcm" | "polar_difference.dcm")[];
            /** @description The scan at stress: a volume, or the segmentation or beat of one */
            stress: string;
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description The main figures of a comparison of rest and stress; the report has all. */
        ComparisonSummary: {
            /**
             * Format: double
             * @description The lesser confidence of both fits, 0 to 1.
             */
            confidence: number;
            /**
             * Format: double
             * @description Change of the ejection fraction from rest to stress, points; `null` unless both scans are gated.
             */
            ef_change_points?: number | null;
            /**
             * Format: double
             * @description Share of the wall below the threshold in both scans.
             */
            fixed_percent: number;
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /** @description Its interval by noise, 5th and 95th percentile; not there in comparisons made before it existed. */
            reversible_interval_percent?: number[] | null;
            /**
             * Format: double
             * @description Share of the wall that loses uptake at stress.
             */
            reversible_percent: number;
            reversible_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: int32
             * @description Summed difference score.
             */
            sds?: number | null;
            /**
             * Format: int32
             * @description Summed rest score.
             */
            srs?: number | null;
            /**
             * Format: int32
             * @description Summed stress score, 0 to 68; `null` without normal limits, as for all scores.
             */
            sss?: number | null;
            /**
             * Format: double
             * @description Ratio of the cavities, stress to rest (transient ischaemic dilation).
             */
            tid: number;
        };
        /** @description A point of the volume curve. */
        CurvePoint: {
            /**
             * Format: double
             * @description Volume of the cavity.
             */
            cavity_ml: number;
            /**
             * Format: double
             * @description When.
             */
            degrees: number;
        };
        /** @description A message about a job to one receiver. */
        Delivery: {
            /**
             * Format: int32
             * @description Number of attempts.
             */
            attempts: number;
            /**
             * @description The event that it tells.
             * @example succeeded
             */
            event: string;
            /**
             * @description Its id; the header `webhook-id` of every attempt.
             * @example msg_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /**
             * Format: date-time
             * @description When it was tried last (RFC 3339).
             */
            last_attempt_at?: string | null;
            /**
             * @description How it last ended: `delivered`, `gone` (410), `rejected` (another status), `timed-out`,
             *     `unreachable`, `refused` (by this service, for its address), `too-old`, `too-many`,
             *     `endpoint-removed`, `interrupted` (the service ended during the last attempt).
             */
            last_outcome?: string | null;
            /**
             * Format: int32
             * @description The status of the receiver's last answer.
             */
            last_status?: number | null;
            /**
             * Format: date-time
             * @description When it is tried next (RFC 3339).
             */
            next_attempt_at?: string | null;
            /**
             * Format: date-time
             * @description When the event happened (RFC 3339).
             */
            occurred_at: string;
            /**
             * @description `pending`, `delivered`, or `dead` if it was given up.
             * @example delivered
             */
            state: string;
            /** @description Where it goes. */
            url: string;
            /** @description The registered webhook; absent for the job's own. */
            webhook?: string | null;
        };
        /** @description The messages about a job. */
        DeliveryList: {
            /** @description The newest first, at most 100. */
            deliveries: components["schemas"]["Delivery"][];
        };
        /** @description Something that the service depends on. */
        Dependency: {
            /** @description The reason why it does not work. */
            detail?: string | null;
            /**
             * @description `database`, `audit` (the audit trail), `files`, `disk`, `workers` (processes that compute jobs), or `clock`
             *     (whether ages count by the time of day).
             * @example database
             */
            name: string;
            /** @description Whether no work can be accepted without it. */
            required: boolean;
            /**
             * @description `ok` or `failing`.
             * @example ok
             */
            status: string;
        };
        /**
         * @description Data sets; a request has one
         * @example [
         *       {
         *         "00741000": {
         *           "vr": "CS",
         *           "Value": [
         *             "SCHEDULED"
         *           ]
         *         }
         *       }
         *     ]
         */
        DicomJson: {
            [key: string]: unknown;
        }[];
        /** @description Distances between a model and its surface, and what they enclose. */
        Distance: {
            /**
             * Format: double
             * @description Area of the model beyond that of the surface, percent of it.
             */
            area_error_percent: number;
            /**
             * Format: double
             * @description Upper bound of the largest distance, mm; absent for very large meshes.
             */
            hausdorff_at_most_mm?: number | null;
            /**
             * Format: double
             * @description The largest distance of either direction (Hausdorff) that was found, mm: a lower bound.
             */
            hausdorff_mm: number;
            /**
             * Format: double
             * @description The Hausdorff distance in the same unit.
             */
            hausdorff_voxels: number;
            /**
             * Format: double
             * @description The larger of the two directions' 95th percentiles, mm.
             */
            hd95_mm: number;
            /**
             * Format: double
             * @description Mean of the two directions' means, mm.
             */
            mean_mm: number;
            /**
             * Format: double
             * @description The mean in units of the smallest voxel spacing.
             */
            mean_voxels: number;
            /** @description From points of the model to the surface. */
            model_to_surface: components["schemas"]["DistanceDirection"];
            /**
             * Format: double
             * @description Root mean square over both directions, mm.
             */
            rms_mm: number;
            /** @description From points of the surface to the model. */
            surface_to_model: components["schemas"]["DistanceDirection"];
            /**
             * Format: double
             * @description Volume enclosed by the surface, millilitres.
             */
            surface_volume_ml: number;
            /**
             * Format: double
             * @description Volume that the model encloses beyond that of the surface, percent of it.
             */
            volume_error_percent: number;
            /**
             * Format: double
             * @description Volume enclosed by the model, millilitres.
             */
            volume_ml: number;
            /**
             * Format: double
             * @description The smallest voxel spacing, mm.
             */
            voxel_mm: number;
        };
        /** @description Distances of one side's points to the other side. */
        DistanceDirection: {
            /**
             * Format: double
             * @description Upper bound of the largest distance, mm; absent for very large meshes.
             */
            max_at_most_mm?: number | null;
            /**
             * Format: double
             * @description Largest distance found at any point, mm.
             */
            max_mm: number;
            /**
             * Format: double
             * @description Mean over the even samples, mm.
             */
            mean_mm: number;
            /**
             * Format: double
             * @description 95th percentile over the even samples, mm.
             */
            p95_mm: number;
            /**
             * Format: double
             * @description Root mean square over the even samples, mm.
             */
            rms_mm: number;
            /**
             * Format: int64
             * @description Number of even samples.
             */
            samples: number;
        };
        /** @description A file that can be downloaded. */
        Download: {
            /**
             * Format: int64
             * @description Its length in bytes.
             */
            bytes: number;
            /** @description Its path. */
            href: string;
            /** @description Its media type. */
            media_type: string;
            /**
             * @description The file's name.
             * @example mesh.glb
             */
            name: string;
            /** @description SHA-256 of its content, hexadecimal; also its `ETag`. */
            sha256: string;
        };
        /** @description A file of an erased item. */
        ErasedFile: {
            /**
             * Format: int64
             * @description Its length in bytes.
             */
            bytes: number;
            /** @description Its name in the store. */
            name: string;
            /** @description SHA-256 of its content, hexadecimal. */
            sha256: string;
        };
        /** @description An erased item. */
        ErasedItem: {
            /** @description Its files. */
            files: components["schemas"]["ErasedFile"][];
            /** @description Whether its files were erased; not if another tenant stored the same content. */
            files_erased: boolean;
            /** @description Its id. */
            id: string;
        };
        /** @description What an erasure would erase, and what stands in its way. */
        ErasurePlan: {
            /** @description The volumes and what would go with them. */
            items: components["schemas"]["PlannedItem"][];
            /** @description The ended jobs whose records would go. */
            jobs: string[];
            /** @description Items on legal hold: selected, or another source of something that would go. Nothing is erased while there are any. */
            legal_holds: string[];
            /** @description Items that a request needs at this moment. Nothing is erased while there are any. */
            pinned: string[];
            /**
             * @description A name for exactly these items and jobs.
             * @example 9f86d081884c7d659a2feaa0c55ad015
             */
            plan: string;
            /** @description What was made of the volumes and would stay, with `cascade=false`: send `cascade=true` to erase it too. */
            stays: string[];
            /** @description Jobs that have not ended and need one of the items. Nothing is erased while there are any. */
            unfinished_jobs: string[];
            /**
             * Format: int64
             * @description Volumes whose scan a repair of the database has lost and that were not read again yet, so that they may be missing
             *     here.
             */
            unread_volumes: number;
            /** @description The volumes that are selected. */
            volumes: string[];
        };
        /**
         * @description Why something was erased.
         * @enum {string}
         */
        ErasureReason: "request" | "retention";
        /** @description The figures behind confidence and flags. */
        Evidence: {
            /**
             * Format: double
             * @description Share of sensors that see an edge.
             */
            active_sensors: number;
            /**
             * Format: double
             * @description Mean correlation of image and wall in their projections; null where the orientation is unknown.
             */
            agreement_of_views?: number | null;
            /**
             * Format: double
             * @description Share of the wall beside which something takes up more than that.
             */
            beside: number;
            /**
             * Format: double
             * @description Volume of the cavity.
             */
            cavity_ml: number;
            /**
             * Format: double
             * @description Chance that the patient moved, 0 to 1.
             */
            chance_of_motion: number;
            /**
             * Format: double
             * @description Share of the wall that takes up less than half as much as the bright wall does.
             */
            dark: number;
            /**
             * Format: double
             * @description Share of the projections that show the second place; null likewise.
             */
            displaced_share?: number | null;
            /**
             * Format: double
             * @description Distance of the two places along the bed; null likewise.
             */
            displacement_mm?: number | null;
            /**
             * Format: double
             * @description How much better two places of the wall in two runs of projections explain the image than one, as a share of what one leaves unexplained; null likewise.
             */
            gain_of_two_places?: number | null;
            /**
             * Format: double
             * @description Share of the wall's brightness that the cavity lacks, 0 to 1.
             */
            hollowness: number;
            /**
             * Format: double
             * @description How far the middle of the wall lies off the axis, as a share of that mean.
             */
            offset: number;
            /**
             * Format: double
             * @description Distance to the edges, weighted root mean square.
             */
            residual_mm: number;
            /**
             * Format: double
             * @description Distance of the septum from the axis over that of the free wall.
             */
            septal_bulge: number;
            /**
             * Format: double
             * @description Length from rim to apex over the outer radius.
             */
            slenderness: number;
            /**
             * Format: double
             * @description Root of the mean squared strain.
             */
            strain: number;
            /**
             * Format: double
             * @description Mean distance of the nodes from the fits of the other built-in hearts; null without them.
             */
            template_spread_mm?: number | null;
            /**
             * Format: double
             * @description Standard deviation of the wall's thickness.
             */
            thickness_spread_mm: number;
            /**
             * Format: double
             * @description Standard deviation of the distance from the axis to the middle of the wall, as a share of its mean.
             */
            unroundness: number;
        };
        /** @description A case that is in no group. */
        ExcludedCase: {
            /** @description The name in the table. */
            case: string;
            /** @description Why. */
            reason: string;
        };
        FhirBundle: {
            /** @description The DiagnosticReport first, then what it refers to */
            entry: Record<string, never>[];
            /** @enum {string} */
            resourceType: "Bundle";
        } & {
            [key: string]: unknown;
        };
        /** @description A figure beside its limits. */
        FigureBeside: {
            /** @description Its name in the limits, with its unit. */
            figure: string;
            /**
             * Format: double
             * @description Quantile of 97.5 per cent.
             */
            high: number;
            /**
             * Format: double
             * @description Quantile of 2.5 per cent.
             */
            low: number;
            /**
             * Format: double
             * @description Normal mean.
             */
            mean: number;
            /**
             * Format: int64
             * @description Number of people.
             */
            n: number;
            /**
             * Format: double
             * @description Normal standard deviation.
             */
            sd: number;
            /**
             * Format: int64
             * @description The segment, 1 to 17; null for the whole heart.
             */
            segment?: number | null;
            /**
             * Format: double
             * @description This scan's.
             */
            value: number;
            /** @description Whether it lies between `low` and `high`. */
            within: boolean;
            /**
             * Format: double
             * @description Standard deviations from the normal mean; null where people do not differ.
             */
            z?: number | null;
        };
        /** @description The change of a figure from an earlier to a later scan. */
        FigureChange: {
            /**
             * Format: double
             * @description The later figure less the earlier one.
             */
            change: number;
            /**
             * Format: int64
             * @description The earlier scan.
             */
            earlier: number;
            /** @description The figure: its name in `scans`. */
            figure: string;
            /** @description The 95 % interval of the change. */
            interval: number[];
            /**
             * Format: int64
             * @description The later one.
             */
            later: number;
            /**
             * Format: double
             * @description The least change that nine of ten such pairs of scans would show.
             */
            least_change: number;
            /** @description Whether it changed. */
            verdict: components["schemas"]["Verdict"];
        };
        /** @description The mean of a figure over a segment. */
        FigureSegment: {
            /**
             * Format: double
             * @description The mean; null where there is none.
             */
            mean?: number | null;
            /** @description Its name. */
            name: string;
            /**
             * Format: int64
             * @description 1 to 17.
             */
            number: number;
        };
        /** @description The statements of a volume's file. */
        FileFacts: {
            /** @description Maps a voxel index to LPS millimetres; row by row. */
            affine_lps: number[][];
            /** @description Maps a voxel index to RAS millimetres; row by row. */
            affine_ras: number[][];
            /** @description The part of the header that gave the affine. */
            affine_source: string;
            /** @description `little` or `big`. */
            byte_order: string;
            /** @description Whether it was gzipped. */
            compressed: boolean;
            /** @description Data type in the file. */
            data_type: string;
            /** @description Sizes of all dimensions in the file. */
            file_shape: number[];
            /** @description File format. */
            format: string;
            /**
             * Format: int64
             * @description The frame that was read, counted from 0.
             */
            frame?: number | null;
            /**
             * Format: int64
             * @description Frames in the file.
             */
            frames: number;
            /** @description The voxel values after slope and intercept. */
            intensity: components["schemas"]["IntensityFacts"];
            scaling?: components["schemas"]["Scaling"] | null;
            /** @description Voxels along i, j, k. */
            shape: number[];
            /** @description Voxel spacing, millimetres. */
            spacing_mm: number[];
            /** @description The file's unit of length. */
            unit: string;
            /** @description Oddities of the file that do not prevent its use. */
            warnings: string[];
        };
        /** @description Figures of a fit, and the fitted model's pose. */
        Fit: {
            /**
             * Format: double
             * @description Share of sensors that see an edge.
             */
            active_sensors: number;
            /**
             * Format: double
             * @description Chance that a reader who draws the visible edge agrees with the mask by a Jaccard index of 0.75 or more, calibrated on
             *     simulated scans, 0 to 1; of other organs, half the share of the surface that sees an edge.
             */
            confidence: number;
            /** @description How far each vertex moved, mm. */
            displacement_mm: number[];
            /** @description Kinetic energy after each step. */
            energy: number[];
            /**
             * Format: int64
             * @description Steps of the motion.
             */
            iterations: number;
            long_axis?: components["schemas"]["LongAxis"] | null;
            /** @description Why the motion ended. */
            reason: string;
            /**
             * Format: double
             * @description Distance to the edges, weighted root mean square.
             */
            residual_mm: number;
            /**
             * Format: double
             * @description Standard deviation of the height of the ventricle's rim, mm; where anatomy and image together put it.
             */
            rim_uncertainty_mm?: number | null;
            /** @description Rotation of the model; row by row. */
            rotation: number[][];
            /**
             * Format: int64
             * @description Runs from different starts.
             */
            runs: number;
            /**
             * Format: double
             * @description Size relative to the model.
             */
            scale: number;
            /**
             * Format: int64
             * @description Intersecting pairs of triangles.
             */
            self_intersections: number;
            /**
             * Format: double
             * @description Chance that the true cavity is within 20 % of the anatomical one, calibrated on simulated scans, 0 to 1: how sure the
             *     *size* is, where `confidence` says how sure the *place* of the visible edge is; ventricles only.
             */
            size_confidence?: number | null;
            /**
             * Format: double
             * @description Root of the mean squared strain.
             */
            strain: number;
            /**
             * Format: int64
             * @description Triangles that turned over.
             */
            turned_triangles: number;
        };
        /** @description All forms of the fitness after each stage. */
        FitnessFormStages: {
            /** @description After the least-squares fit. */
            fitted: components["schemas"]["FitnessForms"];
            /** @description After optimisation. */
            optimised: components["schemas"]["FitnessForms"];
            /** @description After re-tiling. */
            retiled: components["schemas"]["FitnessForms"];
        };
        /** @description Mean fitness in every form. */
        FitnessForms: {
            /**
             * Format: double
             * @description Every term in (0, 1].
             */
            normalised: number;
            /**
             * Format: double
             * @description The paper's reciprocal terms, capped.
             */
            raw: number;
            /**
             * Format: double
             * @description Angles in degrees floored at 1, distance in mm floored at 0.01, equal weights:
             *     comparable between tools.
             */
            robust: number;
        };
        /** @description The paper's fitness: mean over all edges. */
        FitnessReport: {
            /**
             * Format: double
             * @description After the least-squares fit, before the last flips.
             */
            fitted: number;
            /** @description The form in which `retiled`, `fitted` and `optimised` are given: the one that drove the flips. */
            form: string;
            /** @description All forms after each stage. */
            forms: components["schemas"]["FitnessFormStages"];
            /**
             * Format: double
             * @description From re-tiled to optimised, percent.
             */
            gain_percent: number;
            /**
             * Format: double
             * @description After optimisation.
             */
            optimised: number;
            /**
             * Format: double
             * @description After re-tiling.
             */
            retiled: number;
            /** @description Numerators and floors of every form. */
            scales: {
                [key: string]: components["schemas"]["FitnessScales"];
            };
            /** @description Mean terms after each stage. */
            terms: components["schemas"]["FitnessTermStages"];
            /** @description Weights of the four terms. */
            weights: number[];
        };
        /** @description Numerators and floors of the four terms. */
        FitnessScales: {
            /** @description Floors, in radians and millimetres. */
            floor: number[];
            /** @description Numerators, in radians and millimetres. */
            numerator: number[];
        };
        /** @description Mean terms of the fitness after each stage. */
        FitnessTermStages: {
            /** @description After the least-squares fit. */
            fitted: components["schemas"]["FitnessTerms"];
            /** @description After optimisation. */
            optimised: components["schemas"]["FitnessTerms"];
            /** @description After re-tiling. */
            retiled: components["schemas"]["FitnessTerms"];
        };
        /** @description Means of the four terms over all edges. */
        FitnessTerms: {
            /**
             * Format: double
             * @description Angle between the normals of the edge's triangles, degrees.
             */
            a_deg: number;
            /**
             * Format: double
             * @description Mean angle to the four outer neighbours, degrees.
             */
            b_deg: number;
            /**
             * Format: double
             * @description R/(2r) of the two triangles, 1 = equilateral.
             */
            c: number;
            /**
             * Format: double
             * @description Distance of the edge's midpoint to the surface, mm.
             */
            d_mm: number;
        };
        /** @description Volumes of a fitted model, millilitres. */
        FittedVolumes: {
            anatomical?: components["schemas"]["WallVolumes"] | null;
            anatomical_interval?: components["schemas"]["VolumeIntervals"] | null;
            apparent?: components["schemas"]["WallVolumes"] | null;
            /**
             * Format: double
             * @description Of its cavity; ventricles only.
             */
            cavity?: number | null;
            /**
             * Format: double
             * @description Of the wall that `edge` asks for, or of the whole organ.
             */
            wall: number;
        };
        /** @description A reason to look closer. */
        Flag: {
            /** @description Its stable name. */
            code: string;
            /** @description The finding. */
            reason: string;
        };
        /** @description A gate. */
        GateReport: {
            /**
             * Format: double
             * @description Volume of the cavity.
             */
            cavity_ml: number;
            /**
             * Format: double
             * @description The factor that brought the gate to the usual counts of a gate.
             */
            counts_factor: number;
            /**
             * Format: int64
             * @description The volume of the input that it is, counted from 0 as the parameter `frame` is.
             */
            frame: number;
            /**
             * Format: int64
             * @description Its number, from 1.
             */
            gate: number;
            /**
             * Format: double
             * @description Volume of the muscle.
             */
            wall_ml: number;
        };
        /** @description The gates of a study, and what its files say of the beats. */
        Gates: {
            /**
             * Format: double
             * @description Beats accepted.
             */
            beats_accepted?: number | null;
            /**
             * Format: double
             * @description Beats rejected.
             */
            beats_rejected?: number | null;
            /**
             * Format: int64
             * @description R-R intervals into which the beats were sorted by their length.
             */
            intervals: number;
            /**
             * Format: int64
             * @description Gates of one R-R interval.
             */
            number: number;
            /**
             * Format: double
             * @description The R-R interval, ms; `null` if the files do not say, or have several: that with the most counts is taken.
             */
            rr_ms?: number | null;
        };
        /** @description Limits of a figure of the whole heart, or of a segment. */
        GlobalLimit: {
            /** @description `cavity_ml`, `wall_ml`, `tid`, `ef_percent`, `edv_ml`, `esv_ml`, `phase_sd_degrees`, `phase_bandwidth_degrees`, `motion_mm` or `thickening_percent`. */
            figure: string;
            /**
             * Format: double
             * @description Quantile of 97.5 per cent.
             */
            high: number;
            /**
             * Format: double
             * @description Quantile of 2.5 per cent, linear between the people.
             */
            low: number;
            /**
             * Format: double
             * @description Mean.
             */
            mean: number;
            /**
             * Format: int64
             * @description Number of people.
             */
            n: number;
            /**
             * Format: double
             * @description Standard deviation.
             */
            sd: number;
            /**
             * Format: int64
             * @description The segment of motion or thickening, 1 to 17; null for the whole heart.
             */
            segment?: number | null;
        };
        /**
         * @description The people of a group of normal limits.
         * @enum {string}
         */
        GroupSex: "F" | "M" | "mixed";
        /** @description The state of the service. */
        Health: {
            /**
             * @description Always `ok`.
             * @example ok
             */
            status: string;
            /** @description The program's version. */
            version: string;
        };
        /**
         * @description Counts over equal bins, before and after optimisation side by side. The bin [lower,
         *     lower + width) is the first; the last one includes its upper end.
         */
        Histogram: {
            /**
             * Format: double
             * @description Lower end of the first bin.
             */
            lower: number;
            /** @description Counts of the optimised mesh. */
            optimised: number[];
            /** @description Counts of the re-tiled mesh. */
            retiled: number[];
            /**
             * Format: double
             * @description Width of a bin.
             */
            width: number;
        };
        /** @description Distributions before and after optimisation. */
        Histograms: {
            /** @description Angles between neighbouring triangles' normals, degrees. */
            dihedral_deg: components["schemas"]["Histogram"];
            /** @description Lengths of edges, mm. */
            edge_length_mm: components["schemas"]["Histogram"];
            /** @description Smallest angle of each triangle, degrees. */
            min_angle_deg: components["schemas"]["Histogram"];
            /** @description Radius ratios 2r/R. */
            radius_ratio: components["schemas"]["Histogram"];
            /** @description Edges at each vertex. */
            valence: components["schemas"]["Histogram"];
        };
        /** @description Why a volume is put on legal hold. */
        HoldRequest: {
            /**
             * @description Why the volume must be kept
             * @example Case 17/2026
             */
            reason: string;
        };
        /**
         * @description What is told of a job.
         * @enum {string}
         */
        HookEvent: "started" | "succeeded" | "failed" | "cancelled";
        /** @description A summary of voxel values. */
        Intensity: {
            /**
             * Format: double
             * @description Largest finite value.
             */
            max: number;
            /**
             * Format: double
             * @description Mean of the finite values.
             */
            mean: number;
            /**
             * Format: double
             * @description Smallest finite value.
             */
            min: number;
            /**
             * Format: int64
             * @description Number of voxels that are NaN or infinite.
             */
            not_finite: number;
        };
        /** @description A summary of voxel values. */
        IntensityFacts: {
            /**
             * Format: int64
             * @description Voxels with a finite value.
             */
            finite_voxels: number;
            /** @description Whether all values are whole numbers. */
            integral: boolean;
            /** @description The labels, if the volume looks like a label map. */
            labels?: components["schemas"]["LabelCount"][] | null;
            /**
             * Format: double
             * @description Largest finite value.
             */
            maximum: number;
            /**
             * Format: double
             * @description Mean of the finite values.
             */
            mean: number;
            /**
             * Format: double
             * @description Smallest finite value.
             */
            minimum: number;
            /**
             * Format: int64
             * @description Voxels that are NaN or infinite.
             */
            missing_voxels: number;
            /**
             * Format: double
             * @description Sum of the finite values.
             */
            sum: number;
        };
        /** @description An accepted job. */
        Job: {
            /**
             * Format: int32
             * @description How often a worker has started it.
             */
            attempts: number;
            /** @description The beat it made; only for kind `beat`. */
            beat?: string | null;
            /** @description Whether a client has asked to cancel it. */
            cancel_requested: boolean;
            /** @description The comparison it made; only for kind `comparison`. */
            comparison?: string | null;
            /**
             * Format: date-time
             * @description When it was accepted (RFC 3339).
             */
            created_at: string;
            /** @description The DICOM objects of its result that are sent to an archive. */
            deliveries?: components["schemas"]["ObjectDelivery"][] | null;
            error?: components["schemas"]["Problem"] | null;
            /**
             * Format: date-time
             * @description When it will probably start (RFC 3339), estimated from past jobs. Only while it waits.
             */
            estimated_start?: string | null;
            /** @description The caller's own id for it; not shown to the scope `read`. */
            external_id?: string | null;
            /**
             * Format: date-time
             * @description When it ended (RFC 3339).
             */
            finished_at?: string | null;
            /**
             * @description The job's id.
             * @example job_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f
             */
            id: string;
            /**
             * @description The kind of work.
             * @example model
             */
            kind: string;
            /** @description The caller's own names and values for it; none are shown to the scope `read`. */
            labels: {
                [key: string]: string;
            };
            /** @description Related paths. */
            links: components["schemas"]["JobLinks"];
            /** @description The model it made; only for kind `model`. */
            model?: string | null;
            /** @description The normal limits it built; only for kind `normals`. */
            normals?: string | null;
            /** @description The parameters, including every default. */
            parameters: components["schemas"]["JobParameters"];
            /** @description How urgent it is. */
            priority: components["schemas"]["Priority"];
            /**
             * Format: double
             * @description The share of the work that is done.
             */
            progress: number;
            /**
             * Format: int64
             * @description Place in the queue; the next job to start has 1. Only while it waits.
             */
            queue_position?: number | null;
            /** @description The reading it wrote; only for kind `reading`. */
            reading?: string | null;
            /**
             * Format: int64
             * @description Grows with every change; also the id of the events.
             */
            revision: number;
            /** @description The segmentation it made; only for kind `segmentation`. */
            segmentation?: string | null;
            /** @description The serial comparison it made; only for kind `serial`. */
            serial?: string | null;
            source?: components["schemas"]["JobSource"] | null;
            /**
             * @description The stage of the work, after the first one has begun.
             * @example retile
             */
            stage?: string | null;
            /**
             * Format: date-time
             * @description When a worker last started it (RFC 3339).
             */
            started_at?: string | null;
            /** @description Its state. */
            state: components["schemas"]["JobState"];
            /** @description The volume it works on; `null` until it has been fetched from `source`. */
            volume?: string | null;
        };
        /** @description Paths of one job and of its results. */
        JobLinks: {
            /** @description The beat it made. */
            beat?: string | null;
            /** @description The comparison it made. */
            comparison?: string | null;
            /** @description Its changes as server-sent events. */
            events: string;
            /** @description The segmentation's mask. */
            mask?: string | null;
            /** @description The mesh of what it made. */
            mesh?: string | null;
            /** @description The model it made. */
            model?: string | null;
            /** @description The normal limits it built. */
            normals?: string | null;
            /** @description The reading it wrote. */
            reading?: string | null;
            /** @description The report on what it made. */
            report?: string | null;
            /** @description The segmentation it made. */
            segmentation?: string | null;
            /** @description This job. */
            self: string;
            /** @description The serial comparison it made. */
            serial?: string | null;
            /** @description Its volume, once it is stored. */
            volume?: string | null;
        };
        /** @description A page of jobs. */
        JobList: {
            /** @description The jobs, newest first. */
            jobs: components["schemas"]["Job"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        JobParameters: components["schemas"]["ModelParameters"] | components["schemas"]["SegmentationParameters"] | components["schemas"]["BeatParameters"] | components["schemas"]["ComparisonParameters"] | components["schemas"]["SerialParameters"] | components["schemas"]["NormalsParameters"] | components["schemas"]["ReadingParameters"];
        JobRequest: components["schemas"]["ModelJobRequest"] | components["schemas"]["SegmentationJobRequest"] | components["schemas"]["BeatJobRequest"] | components["schemas"]["ComparisonJobRequest"] | components["schemas"]["SerialJobRequest"] | components["schemas"]["NormalsJobRequest"];
        /** @description A series in an archive. */
        JobSource: {
            /** @description The archive's name. */
            archive?: string | null;
            /**
             * Format: int32
             * @description Number of attempts to fetch it.
             */
            attempts: number;
            /** @description Base URL of its DICOMweb service, if no archive is configured for it. */
            dicomweb?: string | null;
            /** @description Why the last attempt failed. */
            last_error?: string | null;
            /**
             * Format: date-time
             * @description When it is tried next (RFC 3339).
             */
            next_attempt_at?: string | null;
            /** @description Series Instance UID; `null` likewise. */
            series?: string | null;
            /**
             * @description `pending`, `fetched`, or `failed`.
             * @example fetched
             */
            state: string;
            /** @description Study Instance UID; `null` after the volume, or whose scan it is, was erased. */
            study?: string | null;
        };
        /**
         * @description The state of a job.
         * @enum {string}
         */
        JobState: "queued" | "running" | "succeeded" | "failed" | "cancelled";
        /** @description A key. Its secret is shown once, when it is made. */
        Key: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            /**
             * Format: date-time
             * @description From when on it is refused (RFC 3339).
             */
            expires_at?: string | null;
            /**
             * @description Its id.
             * @example 0123456789abcdef
             */
            id: string;
            /** @description The key itself, to be sent as `Authorization: Bearer KEY`. Only in the answer that makes it. */
            key?: string | null;
            /**
             * @description The key that has made it, if a key has: its requests count as requests of that key too.
             * @example fedcba9876543210
             */
            made_by?: string | null;
            /**
             * @description Its name, which says what it is for.
             * @example scanner 2
             */
            name: string;
            /**
             * @description The subject of the OpenID Connect issuer whose key it is: that made it with a token, or with a key of its own.
             * @example contractor-7
             */
            owner?: string | null;
            /**
             * Format: int64
             * @description Jobs of its tenant that may wait; `null` is the service's general limit.
             */
            queued_jobs?: number | null;
            /**
             * Format: int64
             * @description Requests per minute; `null` is the service's general limit.
             */
            requests_per_minute?: number | null;
            /**
             * Format: date-time
             * @description When it was revoked (RFC 3339).
             */
            revoked_at?: string | null;
            /** @description The acts that it allows. */
            scope: components["schemas"]["Scope"];
            /** @description Whether it opens the service. */
            state: components["schemas"]["KeyState"];
            /**
             * Format: int64
             * @description Bytes that its tenant may store; `null` is the service's general limit.
             */
            stored_bytes?: number | null;
            /**
             * @description Whose items and jobs it opens.
             * @example default
             */
            tenant: string;
        };
        /** @description A page of keys. */
        KeyList: {
            /** @description The keys, newest first. */
            keys: components["schemas"]["Key"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /**
         * @description Whether a key opens the service.
         * @enum {string}
         */
        KeyState: "active" | "expired" | "revoked";
        /** @description One label of a label map. */
        LabelCount: {
            /**
             * Format: int64
             * @description Value of the voxels.
             */
            label: number;
            /**
             * Format: int64
             * @description Number of voxels with that value.
             */
            voxels: number;
        };
        /** @description The level of a reader's profile, a share of the polar map's reference. */
        LearntLevel: {
            /**
             * Format: double
             * @description Mean over the masks.
             */
            mean: number;
            /**
             * Format: double
             * @description Standard deviation over the masks; 0 for one mask.
             */
            spread: number;
            /**
             * Format: double
             * @description The applied level: the mean, drawn towards the usual level.
             */
            value: number;
        };
        /** @description One distance of a reader's profile, mm. */
        LearntOffset: {
            /**
             * Format: double
             * @description Mean over the masks.
             */
            mean: number;
            /**
             * Format: double
             * @description Standard deviation over the masks; 0 for one mask.
             */
            spread: number;
            /**
             * Format: double
             * @description The applied offset: the mean, drawn towards zero.
             */
            value: number;
        };
        /** @description The distances of a reader's profile. */
        LearntOffsets: {
            /** @description Inner surface, outward. */
            endocardium: components["schemas"]["LearntOffset"];
            /** @description Outer surface, outward. */
            epicardium: components["schemas"]["LearntOffset"];
            /** @description Rim, towards the base. */
            rim: components["schemas"]["LearntOffset"];
        };
        /** @description A scan and its mask that a profile was learnt on. */
        LearntOn: {
            /** @description SHA-256 of the mask's file, hexadecimal. */
            mask: string;
            /** @description SHA-256 of the scan's file, hexadecimal. */
            scan: string;
        };
        /** @description A person judged by the limits of the others. */
        LeftOut: {
            /** @description The name in the table. */
            case: string;
            /**
             * Format: double
             * @description Deficit score, per cent.
             */
            deficit_percent: number;
            /**
             * Format: double
             * @description Share of the wall beyond the limit, per cent.
             */
            extent_percent: number;
            /**
             * Format: int32
             * @description Sum of the segments' scores.
             */
            summed_score: number;
        };
        /** @description A legal hold. */
        LegalHold: {
            /** @description The name of the key that set it. */
            by: string;
            /** @description The reason that was given; not shown to the scope `read`. */
            reason?: string | null;
            /**
             * Format: date-time
             * @description Since when (RFC 3339).
             */
            since: string;
        };
        /**
         * @description Normal uptake at every place of the polar map: 32 rows from apex to base, 60 columns from lateral over anterior, septal and inferior. The
         *     area-weighted mean of `mean` over the places that have one is 1.
         */
        LimitMap: {
            /** @description Mean; null where too few of the people have muscle. */
            mean: (number | null)[][];
            /**
             * @description Covariance of the coefficients by which healthy people differ from the mean as a whole: of 2 r - 1, r cos a, r sin a, (2 r - 1)² - 1/3, r cos 2a,
             *     r sin 2a, with the way r from apex (0) to base (1) and the angle a from lateral over anterior. `sd` is what is left beside these.
             */
            pattern_covariance: number[][];
            /** @description Standard deviation, the uncertainty of so small a sample's mean and deviation included. */
            sd: (number | null)[][];
        };
        /** @description Where the organ was found. */
        Localisation: {
            /** @description Direction from base to apex. */
            axis: number[];
            /** @description Its centre. */
            centre: number[];
            /**
             * Format: double
             * @description Confidence of the search, 0 to 1.
             */
            confidence: number;
            /**
             * Format: double
             * @description Correlation with the shape sought.
             */
            correlation: number;
            /**
             * Format: double
             * @description Hollowness, 0 to 1.
             */
            hollowness: number;
            /**
             * Format: double
             * @description Its length, mm.
             */
            length_mm: number;
            /**
             * Format: double
             * @description Correlation of the next best place.
             */
            runner_up?: number | null;
        };
        /** @description The ends of a ventricle's long axis. */
        LongAxis: {
            /** @description The apex. */
            apex: number[];
            /** @description Centre of the base. */
            base: number[];
        };
        MeshDocument: {
            /** @description A figure of each point: `Uptake` (per cent) of a fitted wall, `Distance` (mm) of a model to the surface that it was made of; null where it is not known */
            fields?: {
                [key: string]: (number | null)[];
            };
            /** @enum {string} */
            frame?: "LPS";
            /** @description The volume's DICOM frame of reference */
            frame_of_reference_uid?: string;
            /** @description Unit normals of the points, outward */
            normals?: number[][];
            /** @description The part of a left ventricle's wall that each triangle is of: 1 endocardium, 2 epicardium, 3 base */
            part?: number[];
            /** @description Its main figures */
            quality?: Record<string, never>;
            /** @description The program that made it */
            software?: string;
            /** @description What the mesh shows */
            title?: string;
            /** @description Indices of three vertices each, counter-clockwise seen from outside */
            triangles: number[][];
            /** @description Standard deviation of each point's distance from the true surface */
            uncertainty_mm?: number[];
            /** @enum {string} */
            unit?: "mm";
            /** @description Points, LPS millimetres */
            vertices: number[][];
            /** @description Id of the volume it was made of */
            volume?: string;
        };
        /** @description Counts, topology and size of a mesh. */
        MeshFacts: {
            /** @description No edge has a single triangle. */
            closed: boolean;
            /** @description The first defect found, in words. */
            defect?: string | null;
            /** @description No edge has more than two triangles. */
            edge_manifold: boolean;
            /**
             * @description Neighbouring triangles traverse their common edge in opposite directions, so that their
             *     normals point to the same side.
             */
            oriented: boolean;
            /** @description The triangles face outward (the enclosed volume is positive). */
            outward: boolean;
            /**
             * Format: int64
             * @description Components with a positive enclosed volume. The others bound cavities of the wall, or face
             *     the wrong way.
             */
            outward_components: number;
            /** @description The triangles about every vertex form one cycle, and every edge has two of them. */
            vertex_manifold: boolean;
            /**
             * Format: double
             * @description Area, mm².
             */
            area_mm2: number;
            /**
             * Format: int64
             * @description Connected components.
             */
            components: number;
            /**
             * Format: int64
             * @description Number of edges.
             */
            edges: number;
            /**
             * Format: int64
             * @description Euler characteristic V - E + F: 2 for each component without handles. Only vertices in
             *     use count.
             */
            euler_characteristic: number;
            /**
             * Format: int64
             * @description Handles over all components, of a closed manifold.
             */
            genus?: number | null;
            /** @description Largest coordinates, LPS mm. */
            max_mm: number[];
            /** @description Smallest coordinates, LPS mm. */
            min_mm: number[];
            /**
             * Format: int64
             * @description Pairs of triangles that meet in more than shared vertices and edges, found exactly.
             */
            self_intersections: number;
            /**
             * Format: int64
             * @description Number of triangles.
             */
            triangles: number;
            /**
             * Format: int64
             * @description Number of vertices.
             */
            vertices: number;
            /**
             * Format: double
             * @description Enclosed volume, millilitres.
             */
            volume_ml: number;
        };
        /** @description A model: what it was made of, its main figures, and its files. */
        Model: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example mdl_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["ModelLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["ModelParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description Counts and main figures; the report has all figures. */
            summary: components["schemas"]["ModelSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        /** @enum {string} */
        ModelFileName: "mesh.glb" | "mesh.gltf" | "mesh.stl" | "mesh.ply" | "mesh.obj" | "mesh.vtp" | "mesh.vtk" | "mesh.json" | "report.json" | "report.html" | "distance.json" | "mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm";
        ModelJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "model";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["ModelParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm")[];
            source?: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one model. */
        ModelLinks: {
            /** @description DICOM objects of the scan's patient and study, for the archive. */
            dicom: string[];
            /** @description Its mesh, in the format that `Accept` asks for. */
            mesh: string;
            /** @description The report as an HTML page. */
            page: string;
            /** @description Its quality report. */
            report: string;
            /** @description This model. */
            self: string;
            /** @description Its volume. */
            volume: string;
        };
        /** @description A page of models. */
        ModelList: {
            /** @description The models, newest first. */
            models: components["schemas"]["Model"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /** @description The parameters of a model */
        ModelParameters: {
            /** @description Higher density of points where the surface is curved: the spacing is proportional to curvature^-adaptive; 0 is uniform (default for refined: 0.25, for paper: 0) */
            adaptive?: number;
            /**
             * @description Smallest height of the surface over one edge of uniform spacing, in percent of the surface's size, at which `adaptive` takes effect; 0 adapts everywhere
             * @default 0.8
             */
            adaptive_from?: number;
            /** @description Search for the object only inside this box of voxels: i0,j0,k0,i1,j1,k1, counted from 0, both corners included */
            box?: number[];
            /**
             * @description auto measures the noise of the scan and takes that much off its surface; off leaves the surface at the iso-value of the voxels (default for refined: auto, for paper: off)
             * @enum {string}
             */
            denoise?: "auto" | "off";
            /**
             * @description Weight of even dihedral angles in the fit, for triangles as small as a voxel; lowers the largest distance and the dihedral angles
             * @default 0.07
             */
            fit_bend_weight?: number;
            /**
             * @description Weight that holds vertices in place in each round of the fit
             * @default 0.0005
             */
            fit_damping?: number;
            /**
             * @description Target size of triangles in the fit: 0 pulls them all to one size, 1 keeps the size that each has
             * @default 1
             */
            fit_free_size?: number;
            /**
             * @description Number of flips that the fit looks ahead to let irregular vertices cancel
             * @default 3
             */
            fit_glide?: number;
            /**
             * @description Weight of the distances from the model's edge midpoints and triangle centres to the surface in the fit
             * @default 1
             */
            fit_midpoint_weight?: number;
            /**
             * @description Share of its previous step that a vertex repeats in each round of the fit
             * @default 0.6
             */
            fit_momentum?: number;
            /**
             * @description Additional weight of distant samples in the fit; lowers the largest distance
             * @default 0.02
             */
            fit_peak_weight?: number;
            /** @description Rounds of the least-squares fit; 0 leaves the points on the surface (default for refined: 10, from 600 points on 8; for paper: 0) */
            fit_rounds?: number;
            /**
             * @description Samples of the surface per triangle of the model in the fit; fewer, at least 6, where the surface's own triangles are larger
             * @default 16
             */
            fit_samples?: number;
            /**
             * @description Weight of the triangles' shape relative to the squared distance in the fit
             * @default 0.06
             */
            fit_shape_weight?: number;
            /**
             * @description Additional weight of badly shaped triangles in the fit
             * @default 3
             */
            fit_worst_weight?: number;
            /**
             * @description Form of the fitness that the flips raise: raw (the paper's reciprocals), normalised (each term between 0 and 1), or robust (reciprocals with a floor of 1 degree and 0.01 mm) (default for refined: normalised, for paper: raw)
             * @enum {string}
             */
            fitness?: "raw" | "normalised" | "robust";
            /** @description Frame of a 4-D volume or gate, counted from 0 (0 is the first); without it, the gates of a heart beat are summed */
            frame?: number;
            /**
             * @description What a flip must raise: local (the fitness of the pair of triangles, as in the paper) or total (the fitness of the mesh) (default for refined: total, for paper: local)
             * @enum {string}
             */
            gain?: "local" | "total";
            /**
             * @description Geodesic distances that the repulsion uses (method paper): exact ones take many times longer and are meant for validation
             * @default approximate
             * @enum {string}
             */
            geodesics?: "approximate" | "exact";
            /** @description Radius ratio 2r/R below which a flip must not create a triangle, unless it replaces one that is as bad; 0 allows slivers (default for refined: 0.9, for paper: 0) */
            guard?: number;
            /**
             * @description Iso-value of the surface: auto, a percentage of the ventricle's maximum (50%), an intensity (absolute:0.47), or an intensity below which the object lies (below:0, for signed distances and objects darker than their surroundings)
             * @default auto
             * @example auto, 50% (of the ventricle's maximum), absolute:0.47 or below:0
             */
            iso?: string;
            /**
             * @description Which part of the volume is the object: auto (the left ventricle, or the label of a label map), none (everything above the iso-value) or largest (the largest component)
             * @enum {string}
             */
            isolate?: "auto" | "none" | "largest";
            /** @description Label of the object in a label map; 0 and negative ones too */
            label?: number[];
            /**
             * @description Sigma of the Gaussian that smooths label maps before the surface is extracted, in voxels (edges of a cube of a voxel's volume): the same length along every axis
             * @default 0.8
             */
            mask_smoothing?: number;
            /**
             * @description paper: repulsion and mutual tessellation on the surface; refined: centroidal points, their dual triangulation and a least-squares fit
             * @default refined
             * @enum {string}
             */
            method?: "paper" | "refined";
            /**
             * @description Number of points of the model
             * @default 150
             */
            points?: number;
            /**
             * @description Maximum number of rounds of centroidal relaxation (method refined)
             * @default 50
             */
            relaxation_iterations?: number;
            /**
             * @description Most repetitions of repulsion and tessellation, each from the points of the mesh before (method paper); fewer if the triangles' shape no longer improves
             * @default 8
             */
            repeats?: number;
            /**
             * @description Rounds of geodesic repulsion (method paper)
             * @default 40
             */
            repulsion_iterations?: number;
            /**
             * @description Share of an overlap by which one round of repulsion moves a point
             * @default 0.15
             */
            repulsion_strength?: number;
            /**
             * @description Seed of the random numbers; the same seed gives the same bytes
             * @default 1
             */
            seed?: number;
            /** @description Voxel i,j,k (counted from 0) that belongs to the object */
            seed_point?: number[];
            /** @description Number of models to make, each from another seed; the best is kept (default for refined: 200 points in all, 1 to 4 models; for paper: 1) */
            starts?: number;
            /**
             * @description genus0 removes handles, enclosed cavities and all but one component; keep leaves them
             * @default genus0
             * @enum {string}
             */
            topology?: "genus0" | "keep";
            /**
             * @description Weight of the smoothness between the two triangles of an edge
             * @default 1
             */
            w1?: number;
            /**
             * @description Weight of the smoothness toward the neighbouring triangles
             * @default 1
             */
            w2?: number;
            /**
             * @description Weight of the aspect ratio of the triangles
             * @default 1
             */
            w3?: number;
            /**
             * @description Weight of the distance to the original surface
             * @default 1
             */
            w4?: number;
        };
        /** @description The report of a model. Lengths are millimetres in the patient frame LPS. */
        ModelReport: {
            /** @description The model beside the iso-surface. */
            distance: components["schemas"]["Distance"];
            /** @description The paper's fitness after each stage. */
            fitness: components["schemas"]["FitnessReport"];
            /** @description Distributions before and after optimisation. */
            histograms: components["schemas"]["Histograms"];
            /** @description The volume's file. */
            input: components["schemas"]["FileFacts"];
            /** @description The model: counts and topology. */
            mesh: components["schemas"]["MeshFacts"];
            /** @description Figures of optimisation. */
            optimise: components["schemas"]["OptimiseReport"];
            /** @description Every parameter, defaults written out. */
            parameters: components["schemas"]["ModelParameters"];
            /** @description The mesh before optimisation. */
            retile: components["schemas"]["RetileReport"];
            /** @description The model: shape of its triangles. */
            shape: components["schemas"]["Shape"];
            /** @description The model: angles between neighbouring triangles. */
            smoothness: components["schemas"]["Smoothness"];
            /** @description The program that made the model. */
            software: components["schemas"]["Software"];
            /** @description The iso-surface. */
            surface: components["schemas"]["SurfaceReport"];
            /** @description Milliseconds of each stage and their `total`. */
            timings_ms: {
                [key: string]: number;
            };
            /** @description Sentences about the input and the model that a user should know. */
            warnings: string[];
        };
        /** @description The main figures of a model; the report has all. */
        ModelSummary: {
            /**
             * Format: double
             * @description Mean angle between neighbours, degrees.
             */
            dihedral_mean_deg: number;
            /**
             * Format: double
             * @description Mean distance to the surface, mm.
             */
            distance_mean_mm: number;
            /**
             * Format: int64
             * @description V - E + F.
             */
            euler_characteristic: number;
            /**
             * Format: double
             * @description The paper's fitness.
             */
            fitness: number;
            /**
             * Format: double
             * @description Largest distance to the surface, mm.
             */
            hausdorff_mm: number;
            /**
             * Format: double
             * @description Mean 2r/R of the triangles.
             */
            radius_ratio_mean: number;
            /**
             * Format: double
             * @description Smallest 2r/R.
             */
            radius_ratio_min: number;
            /**
             * Format: int64
             * @description Intersecting pairs of triangles.
             */
            self_intersections: number;
            /**
             * Format: int64
             * @description Number of triangles.
             */
            triangles: number;
            /**
             * Format: int64
             * @description Number of vertices.
             */
            vertices: number;
            /**
             * Format: double
             * @description Volume that the model encloses beyond that of the surface, percent of it.
             */
            volume_error_percent: number;
        };
        /** @description One movement of the heart. */
        MoveReport: {
            /**
             * Format: double
             * @description To the back of the patient, mm.
             */
            back_mm: number;
            /**
             * Format: int64
             * @description Number in time of the first view after a step, from 1.
             */
            from_time?: number | null;
            /**
             * Format: double
             * @description Towards the head, mm.
             */
            head_mm: number;
            /** @description `step`, or `drift` over the whole scan. */
            kind: string;
            /**
             * Format: double
             * @description To the left of the patient, mm.
             */
            left_mm: number;
        };
        /** @description A key to be made. */
        NewKey: {
            /**
             * Format: date-time
             * @description From when on it is refused (RFC 3339). If absent, when the key or the token ends that makes it; never if that
             *     never ends.
             */
            expires_at?: string | null;
            /**
             * @description Its name, which says what it is for.
             * @example scanner 2
             */
            name: string;
            /**
             * Format: int64
             * @description Jobs of the tenant that may wait; the service's general limit if absent.
             */
            queued_jobs?: number | null;
            /**
             * Format: int64
             * @description Requests per minute; the service's general limit if absent.
             */
            requests_per_minute?: number | null;
            /**
             * @description The acts that it allows: `read`, `submit` or `admin`.
             * @example submit
             */
            scope: string;
            /**
             * Format: int64
             * @description Bytes that the tenant may store; the service's general limit if absent.
             */
            stored_bytes?: number | null;
        };
        /** @description A scan of which no beat could be compared. */
        NoBeat: {
            /** @description Why. */
            code: components["schemas"]["NoBeatCode"];
            /** @description The same in words. */
            reason: string;
            /** @description The scan. */
            scan: components["schemas"]["WhichScan"];
        };
        /**
         * @description Why there is no beat.
         * @enum {string}
         */
        NoBeatCode: "not_gated" | "few_gates" | "many_gates" | "no_contraction";
        /** @description A healthy person of a group. */
        NormalCase: {
            /** @description The name in the table. */
            case: string;
            /** @description `M` or `F`. */
            sex: components["schemas"]["GroupSex"];
            /** @description SHA-256 of the scan's file, hexadecimal. */
            sha256: string;
        };
        /** @description The limits of one kind of scan. */
        NormalGroup: {
            /** @description Whether attenuation was corrected. */
            attenuation_corrected: boolean;
            /** @description The people, in the order of the table. */
            cases: components["schemas"]["NormalCase"][];
            /** @description Limits of figures of the whole heart. */
            figures: components["schemas"]["GlobalLimit"][];
            /** @description The people, each judged by the limits of the others. */
            leave_one_out: components["schemas"]["Specificity"];
            /** @description Mean and standard deviation of the uptake. */
            map: components["schemas"]["LimitMap"];
            /** @description The protocol. */
            protocol: string;
            /** @description `M`, `F` or `mixed`. */
            sex: components["schemas"]["GroupSex"];
            /** @description The tracer. */
            tracer: string;
        };
        /** @description A group of normal limits. */
        NormalGroupSummary: {
            /** @description Whether attenuation was corrected. */
            attenuation_corrected: boolean;
            /**
             * Format: int64
             * @description Number of people.
             */
            cases: number;
            /**
             * Format: double
             * @description Share of the wall below the limits of the others, mean over the people, per cent.
             */
            mean_extent_percent: number;
            /** @description The protocol. */
            protocol: string;
            /** @description `M`, `F` or `mixed`. */
            sex: components["schemas"]["GroupSex"];
            /** @description The tracer. */
            tracer: string;
        };
        /** @description Normal limits, as `ventriform normals build` writes them. */
        NormalLimits: {
            /** @description Cases that are in no group. */
            excluded: components["schemas"]["ExcludedCase"][];
            /** @description `ventriform-normal-limits`. */
            format: string;
            /** @description One group for each kind of scan. */
            groups: components["schemas"]["NormalGroup"][];
            /** @description Every parameter of the fits, defaults written out. */
            parameters: {
                [key: string]: unknown;
            };
            /** @description What the people are, in words. */
            people: string;
            /** @description The version of the program that built the limits. */
            program_version: string;
            /**
             * Format: int64
             * @description 1.
             */
            schema_version: number;
            /** @description SHA-256 of everything else in this file, hexadecimal. */
            sha256: string;
            /** @description Whether the people are simulated. Such limits are for tests, not for patients. */
            simulated: boolean;
        };
        /** @description Normal limits: the uptake of healthy people, by sex, protocol, tracer and attenuation correction. */
        Normals: {
            /**
             * Format: date-time
             * @description When they were added or built (RFC 3339).
             */
            created_at: string;
            /** @description Their files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant and content, so it is the same on every machine.
             * @example nrm_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["NormalsLinks"];
            /** @description Their name. */
            name: string;
            /** @description The program that added or built them. */
            software: components["schemas"]["Software"];
            /** @description Their content. */
            summary: components["schemas"]["NormalsSummary"];
        };
        /** @enum {string} */
        NormalsFileName: "normals.json";
        /** @description The parameters of normal limits */
        NormalsFitParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /** @description A point of the ventricle's base, x,y,z in LPS millimetres: the rim of the wall is put there (moved by at most 20 mm towards the apex or 40 mm away from it). Default: where image and anatomy put it */
            base?: number[];
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /**
             * @description Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) or anatomical (the wall itself, without the thickness that blur adds). The report has the volumes of both
             * @default apparent
             * @enum {string}
             */
            edge?: "apparent" | "anatomical";
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Whether men and women are one group, where there are too few of each
             * @default false
             */
            mixed?: boolean;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
        };
        NormalsJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "normals";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters: components["schemas"]["NormalsParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            source?: components["schemas"]["SourceRequest"];
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of normal limits. */
        NormalsLinks: {
            /** @description Their file. */
            limits: string;
            /** @description These limits. */
            self: string;
        };
        /** @description A page of normals. */
        NormalsList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The normals, newest first. */
            normals: components["schemas"]["Normals"][];
        };
        /** @description The parameters of normal limits */
        NormalsParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /** @description A point of the ventricle's base, x,y,z in LPS millimetres: the rim of the wall is put there (moved by at most 20 mm towards the apex or 40 mm away from it). Default: where image and anatomy put it */
            base?: number[];
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /** @description The scans of the cohort, and what is known of each */
            cases: components["schemas"]["CohortCase"][];
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /**
             * @description Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) or anatomical (the wall itself, without the thickness that blur adds). The report has the volumes of both
             * @default apparent
             * @enum {string}
             */
            edge?: "apparent" | "anatomical";
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Whether men and women are one group, where there are too few of each
             * @default false
             */
            mixed?: boolean;
            /** @description The name of the limits; not a person's */
            name?: string;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
        };
        NormalsRequest: components["schemas"]["NormalLimits"] | components["schemas"]["CohortRequest"];
        /** @description The content of normal limits; the file has all. */
        NormalsSummary: {
            /**
             * Format: int64
             * @description Cases that are in no group.
             */
            excluded: number;
            /** @description One group for each kind of scan. */
            groups: components["schemas"]["NormalGroupSummary"][];
            /** @description What the people are, in words. */
            people: string;
            /** @description The version of the program that built them. */
            program_version: string;
            /** @description SHA-256 of the limits, as reports name it. */
            sha256: string;
            /** @description Whether the people are simulated. Such limits are for tests, not for patients. */
            simulated: boolean;
        };
        /** @description The group of normal limits that a scan was compared with. */
        NormalsUsed: {
            /** @description Whether attenuation was corrected. */
            attenuation_corrected: boolean;
            /**
             * Format: int64
             * @description Number of people.
             */
            cases: number;
            /** @description What the people are. */
            people: string;
            /** @description Version of the program that built them. */
            program_version: string;
            /** @description The protocol. */
            protocol: string;
            /** @description `M`, `F` or `mixed`. */
            sex: components["schemas"]["GroupSex"];
            /** @description SHA-256 of the limits, hexadecimal. */
            sha256: string;
            /** @description Whether the people are simulated. */
            simulated: boolean;
            /** @description The tracer. */
            tracer: string;
        };
        /** @description Why the service cannot accept work. */
        NotReady: components["schemas"]["Problem"] & {
            /** @description A part that the service depends on. */
            checks: components["schemas"]["Dependency"][];
        };
        /** @description The delivery of a DICOM object to an archive. */
        ObjectDelivery: {
            /**
             * Format: int32
             * @description Number of attempts.
             */
            attempts: number;
            /**
             * @description Its id; absent until the job has succeeded.
             * @example snd_2c26b46b68ffc68ff99b453c1d304134
             */
            id?: string | null;
            /**
             * Format: date-time
             * @description When it was tried last (RFC 3339).
             */
            last_attempt_at?: string | null;
            /** @description Why the last attempt failed. */
            last_error?: string | null;
            /**
             * @description How it last ended: `stored`, `present` (the archive had it already), `failed`, `refused`,
             *     `erased` (here, before it was sent).
             */
            last_outcome?: string | null;
            /**
             * @description The object.
             * @example mask.dcm
             */
            name: string;
            /**
             * Format: date-time
             * @description When it is tried next (RFC 3339).
             */
            next_attempt_at?: string | null;
            /**
             * @description `pending`, `delivered`, or `dead` if it was given up.
             * @example delivered
             */
            state: string;
            /**
             * @description The archive.
             * @example pacs
             */
            to: string;
        };
        /** @description Figures of optimisation. */
        OptimiseReport: {
            /** @description Why it ended: `no_flip_gains`, `cycle` or `sweep_limit`. */
            ended: string;
            /**
             * Format: int64
             * @description Edges flipped during the fit.
             */
            fit_flips: number;
            /**
             * Format: int64
             * @description Rounds of the least-squares fit.
             */
            fit_rounds: number;
            /**
             * Format: int64
             * @description Steps of the fit that were shortened.
             */
            fit_shortened: number;
            /**
             * Format: int64
             * @description Edges flipped.
             */
            flips: number;
            /**
             * Format: int64
             * @description Intersecting pairs of triangles before optimisation.
             */
            self_intersections_before: number;
            /**
             * Format: int64
             * @description Sweeps over all edges.
             */
            sweeps: number;
        };
        /** @description The wall's uptake beside normal limits. */
        Perfusion: {
            /**
             * Format: double
             * @description Deficit score: mean score of the wall, per cent of the greatest.
             */
            deficit_percent: number;
            /**
             * Format: double
             * @description Share of the wall below the limit.
             */
            extent_percent: number;
            /** @description Figures of the heart beside their limits; empty where the file has none. */
            figures: components["schemas"]["FigureBeside"][];
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /** @description The limits. */
            normals: components["schemas"]["NormalsUsed"];
            /** @description What the figures are. */
            note: string;
            /** @description The 17 segments. */
            segments: components["schemas"]["SegmentScore"][];
            /**
             * Format: double
             * @description Mean of |z| there; null where nothing is below it.
             */
            severity?: number | null;
            /**
             * Format: double
             * @description The same in per cent of 68.
             */
            summed_percent: number;
            /**
             * Format: int32
             * @description Sum of the segments' scores, 0 to 68.
             */
            summed_score: number;
            /** @description The walls of the three arteries. */
            territories: components["schemas"]["TerritoryScore"][];
            /**
             * Format: double
             * @description Standard deviations below the normal mean at which the limit lies.
             */
            z_limit: number;
        };
        /** @description Phases of the wall: of the first harmonic of the thickness, weighted by area and amplitude. */
        PhaseReport: {
            /**
             * Format: double
             * @description The smallest arc that holds 95 per cent of the weight.
             */
            bandwidth_degrees: number;
            /**
             * Format: double
             * @description Width of a bin.
             */
            bin_degrees: number;
            /**
             * Format: double
             * @description Entropy of the histogram as a share of that of an even one, per cent.
             */
            entropy_percent: number;
            /** @description Share of the weight in equal bins from 0 to 360 degrees. */
            histogram: number[];
            /**
             * Format: double
             * @description Circular mean.
             */
            mean_degrees: number;
            /**
             * Format: double
             * @description How far the noise of the gates alone scatters the phases: of the standard deviation, the part that says nothing of the heart.
             */
            noise_degrees: number;
            /** @description Whether enough of the wall moves, more than noise does, and the gates are a beat. */
            reliable: boolean;
            /**
             * Format: double
             * @description Standard deviation.
             */
            sd_degrees: number;
        };
        /**
         * @description What a ray meets.
         * @enum {string}
         */
        PlaceState: "muscle" | "valve_plane" | "no_wall";
        /** @description An item that would be erased. */
        PlannedItem: {
            /**
             * Format: int64
             * @description Size of all its files in bytes.
             */
            bytes: number;
            /**
             * Format: int64
             * @description Number of its files.
             */
            files: number;
            /**
             * @description Its id.
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            id: string;
        };
        /** @description What attenuation may have to do with the extent of a map. */
        PolarAttenuation: {
            /** @description False if the header or the caller says that attenuation was not corrected; null if nothing says it. */
            corrected?: boolean | null;
            /**
             * Format: double
             * @description The part of `extent_percent` that lies in inferior, inferoseptal and inferolateral segments.
             */
            inferior_extent_percent: number;
            /** @description Both in words, and what is usual without correction. */
            note: string;
        };
        /** @description A figure of the wall on a polar map, as it is written. */
        PolarFigure: {
            /**
             * Format: int64
             * @description Columns of pixels, around the axis.
             */
            columns: number;
            /** @description The figure. */
            figure: components["schemas"]["WallFigure"];
            /**
             * @description For every column, the distances from the apex in rows at which apex, apical, mid and basal level
             *     end; row n reaches from n to n + 1.
             */
            level_ends: number[][];
            /** @description Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`. */
            orientation: string;
            /** @description The values of the first and the last colour of the drawn map. */
            range: number[];
            /** @description The radii at which these levels end on the drawn map, as shares of its own. */
            rings: number[];
            /**
             * Format: int64
             * @description Rows of pixels, from apex to base.
             */
            rows: number;
            /** @description The number of the segment to which each pixel belongs. */
            segment_of: number[][];
            /** @description The 17 segments. */
            segments: components["schemas"]["FigureSegment"][];
            /** @description What lies at each pixel, of figures of uptake: `muscle`, `valve_plane` (hatched, and in no figure) or `no_wall`. */
            states?: components["schemas"]["PlaceState"][][] | null;
            /** @description Its unit: `mm`, `%`, `degrees` of the cycle, `SD` or `score`. */
            unit: string;
            /** @description The pixels; null where there is no wall, none that moves, or nothing to compare. */
            values: (number | null)[][];
        };
        /** @description A polar map, as in `polar.json`. */
        PolarMap: {
            attenuation?: components["schemas"]["PolarAttenuation"] | null;
            /**
             * Format: int64
             * @description Columns of pixels, around the axis.
             */
            columns: number;
            /** @description The order of the columns; null if the orientation is unknown. */
            direction?: string | null;
            /**
             * Format: double
             * @description Share of the wall below it.
             */
            extent_percent: number;
            /** @description Where the first column looks; null if the orientation is unknown. */
            first_column?: string | null;
            /** @description The reference of the percentages. */
            note: string;
            /** @description Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`. */
            orientation: string;
            /**
             * Format: double
             * @description The intensity that counts as 100 per cent.
             */
            reference: number;
            /**
             * Format: int64
             * @description Rows of pixels, from apex to base.
             */
            rows: number;
            /** @description The 17 segments. */
            segments: components["schemas"]["PolarSegment"][];
            /** @description The walls of the three arteries; none if the orientation is unknown. */
            territories: components["schemas"]["Territory"][];
            /**
             * Format: double
             * @description Share of it below which wall counts as a defect.
             */
            threshold_percent: number;
            /**
             * @description For every column, the distances from the apex in rows at which apex, apical, mid and basal level
             *     end; row n reaches from n to n + 1.
             */
            level_ends: number[][];
            /** @description The radii at which these levels end on the drawn map, as shares of its own. */
            rings: number[];
            /** @description The number of the segment to which each pixel belongs. */
            segment_of: number[][];
            /** @description What lies at each pixel: `muscle`, `valve_plane` (hatched, and in no figure) or `no_wall`. */
            states: components["schemas"]["PlaceState"][][];
            /** @description The pixels in per cent of the reference; null where there is no muscle. */
            values_percent: (number | null)[][];
        };
        /** @description One segment of a polar map. */
        PolarSegment: {
            /**
             * Format: double
             * @description Area of its muscle, mm².
             */
            area_mm2: number;
            /**
             * Format: double
             * @description Share of its area below the threshold.
             */
            extent_percent: number;
            /**
             * Format: double
             * @description Mean uptake in per cent of the reference.
             */
            mean_percent?: number | null;
            /** @description Its name. */
            name: string;
            /**
             * Format: int64
             * @description 1 to 17.
             */
            number: number;
            /** @description The coronary artery that usually feeds it; null if the orientation is unknown. */
            territory?: string | null;
        };
        /** @description A polar map without its pixels. */
        PolarSummary: {
            attenuation?: components["schemas"]["PolarAttenuation"] | null;
            /**
             * Format: int64
             * @description Columns of pixels, around the axis.
             */
            columns: number;
            /** @description The order of the columns; null if the orientation is unknown. */
            direction?: string | null;
            /**
             * Format: double
             * @description Share of the wall below it.
             */
            extent_percent: number;
            /** @description Where the first column looks; null if the orientation is unknown. */
            first_column?: string | null;
            /** @description The reference of the percentages. */
            note: string;
            /** @description Source of the sides of the wall: `superior`, `anterior`, `body`, `frame` or `unknown`. */
            orientation: string;
            /**
             * Format: double
             * @description The intensity that counts as 100 per cent.
             */
            reference: number;
            /**
             * Format: int64
             * @description Rows of pixels, from apex to base.
             */
            rows: number;
            /** @description The 17 segments. */
            segments: components["schemas"]["PolarSegment"][];
            /** @description The walls of the three arteries; none if the orientation is unknown. */
            territories: components["schemas"]["Territory"][];
            /**
             * Format: double
             * @description Share of it below which wall counts as a defect.
             */
            threshold_percent: number;
        };
        /** @description Which way is up in the patient. */
        Posture: {
            /**
             * Format: double
             * @description Confidence of that, 0 to 1.
             */
            confidence: number;
            /** @description Its source: `superior`, `anterior`, `body`, `frame` or `unknown`. */
            source: string;
            /** @description The direction to the head. */
            superior: number[];
            /**
             * Format: double
             * @description Its angle to the scanner's axis.
             */
            tilt_degrees: number;
        };
        /**
         * @description How urgent a job is.
         * @enum {string}
         */
        Priority: "urgent" | "routine" | "bulk";
        /** @description Why a request was not fulfilled (RFC 9457). */
        Problem: {
            /** @description What happened this time. */
            detail: string;
            /** @description The parameter, JSON field or header concerned. */
            field?: string | null;
            /** @description What to do about it. */
            fix?: string | null;
            /** @description The job that failed, if there was one. */
            job?: string | null;
            /**
             * Format: int32
             * @description The HTTP status.
             */
            status: number;
            /** @description The kind of problem in words. */
            title: string;
            /**
             * @description Stable identifier of the kind of problem.
             * @example urn:ventriform:problem:unknown-parameter
             */
            type: string;
        };
        /** @description The projections that slices were reconstructed of, and the heart's motion in them. */
        ProjectionsReport: {
            /**
             * Format: double
             * @description Counts of all views.
             */
            counts: number;
            /** @description Whether the heart moved; `null` if that was not measured. */
            moved?: boolean | null;
            /** @description How it moved. */
            moves: components["schemas"]["MoveReport"][];
            /**
             * Format: double
             * @description Edge of a pixel, mm.
             */
            pixel_mm: number;
            /** @description The greatest distance between its places in two views, mm: along the table, and across it on the detector. */
            range_mm?: number[] | null;
            uncorrected?: components["schemas"]["UncorrectedReport"] | null;
            /** @description The views, in the order in which the camera turned. */
            views: components["schemas"]["ViewReport"][];
        };
        /** @description How fast the ventricle empties and fills. */
        RatesReport: {
            /**
             * Format: double
             * @description Greatest rate of ejection, end-diastolic volumes per second.
             */
            peak_ejection_edv_per_s: number;
            /**
             * Format: double
             * @description Greatest rate of filling, end-diastolic volumes per second.
             */
            peak_filling_edv_per_s: number;
            /**
             * Format: double
             * @description From end systole to the greatest rate of filling.
             */
            time_to_peak_filling_ms: number;
        };
        /**
         * @description The kind of result that was read.
         * @enum {string}
         */
        ReadKind: "comparison" | "segmentation" | "beat";
        /** @description The scores of a scan, 0 (normal) to 4 (no uptake). */
        ReadScores: {
            /** @description The automatic ones; `null` without normal limits. */
            automatic?: (number | null)[] | null;
            /**
             * Format: int32
             * @description Their sum.
             */
            automatic_sum?: number | null;
            /** @description `stress`, `rest`, or `scan` where there is one scan. */
            scan: string;
            /** @description Of the 17 segments, by the reader. */
            segments: number[];
            /**
             * Format: int32
             * @description Their sum, 0 to 68.
             */
            sum: number;
        };
        /** @description A reader: a profile by which segmentations are drawn. */
        Reader: {
            /**
             * Format: date-time
             * @description When it was added (RFC 3339).
             */
            created_at: string;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant and profile, so it is the same on every machine.
             * @example rdr_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["ReaderLinks"];
            /** @description Its name. */
            name: string;
            /** @description The program that added it. */
            software: components["schemas"]["Software"];
            /** @description The content of the profile. */
            summary: components["schemas"]["ReaderSummary"];
        };
        /** @enum {string} */
        ReaderFileName: "profile.json";
        /** @description Paths of one reader. */
        ReaderLinks: {
            /** @description Its profile. */
            profile: string;
            /** @description This reader. */
            self: string;
        };
        /** @description A page of readers. */
        ReaderList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The readers, newest first. */
            readers: components["schemas"]["Reader"][];
        };
        /** @description Distances of a reader's wall from the fitted one, mm. */
        ReaderOffsets: {
            /**
             * Format: double
             * @description Distance of the inner surface, positive outward.
             */
            endocardium: number;
            /**
             * Format: double
             * @description Distance of the outer surface, positive outward.
             */
            epicardium: number;
            /**
             * Format: double
             * @description Distance of the rim, positive towards the base.
             */
            rim: number;
        };
        /** @description A reader's profile, as `ventriform calibrate` writes it. */
        ReaderProfile: {
            /** @description The wall that is drawn from: `apparent` or `anatomical`. */
            edge: string;
            /** @description `ventriform-reader-profile`. */
            format: string;
            /**
             * @description `edge`: the reader draws the edge that the image shows, by the distances `offsets_mm` off. `level`: where the image
             *     has a share of the polar map's reference.
             */
            kind: string;
            /** @description The masks it was learnt on. */
            learnt_on: components["schemas"]["LearntOn"][];
            level?: components["schemas"]["LearntLevel"] | null;
            /**
             * Format: int64
             * @description Number of masks that it was learnt on: the length of `learnt_on`.
             */
            masks: number;
            offsets_mm?: components["schemas"]["LearntOffsets"] | null;
            /**
             * Format: int64
             * @description 2.
             */
            version: number;
        };
        /** @description Content of a reader's profile. */
        ReaderSummary: {
            /** @description The wall that is drawn from: `apparent` or `anatomical`. */
            edge: string;
            /**
             * @description `edge`: the reader draws by distances from the edge that the image shows. `level`: where the image has a share of the
             *     polar map's reference.
             */
            kind: string;
            /**
             * Format: double
             * @description The level that is applied, a share of the polar map's reference; `null` for a reader of kind `edge`.
             */
            level?: number | null;
            /**
             * Format: int64
             * @description Number of masks that it was learnt on.
             */
            masks: number;
            offsets_mm?: components["schemas"]["ReaderOffsets"] | null;
        };
        /** @description A reading: what a reader states of a result. It keeps the report and the pictures that were read. */
        Reading: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example rdg_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["ReadingLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["ReadingParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description Who read, when, and the summed scores; the reading has all. */
            summary: components["schemas"]["ReadingSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        /** @enum {string} */
        ReadingFileName: "reading.json" | "report.html" | "comparison.json" | "report.json" | "beat.json" | "mask.nii.gz" | "mesh.json" | "slices.png" | "polar_stress.svg" | "polar_rest.svg" | "polar_difference.svg" | "polar.svg" | "polar_motion.svg" | "polar_thickening.svg" | "polar_phase.svg" | "curve.svg" | "measurements.dcm" | "fhir.json";
        /** @description Paths of one reading. */
        ReadingLinks: {
            /** @description The reading that this one replaces. */
            amends?: string | null;
            /** @description DICOM objects, for the archive. */
            dicom: string[];
            /** @description The structured report as FHIR resources. */
            fhir: string;
            /** @description The reading as an HTML page. */
            page: string;
            /** @description What was stated. */
            report: string;
            /** @description The result that was read. */
            result: string;
            /** @description This reading. */
            self: string;
            /** @description The volume; of a comparison that at stress. */
            volume: string;
        };
        /** @description A page of readings. */
        ReadingList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The readings, newest first. */
            readings: components["schemas"]["Reading"][];
        };
        /** @description What a reader states of a result */
        ReadingParameters: {
            /** @description Id of the reading of the same result that this one replaces; it is kept */
            amends?: string;
            /**
             * @description The impression; it must not name the patient
             * @example No perfusion defect.
             */
            impression?: string;
            /**
             * @description What limits the study; it must not name the patient
             * @example Gut beside the inferior wall.
             */
            limits?: string;
            /**
             * @description How good the study is for a reading
             * @enum {string}
             */
            quality?: "good" | "fair" | "poor";
            /**
             * @description When it was read, UTC
             * @example 2026-11-30T22:15:00Z
             */
            read_at?: string;
            /**
             * @description Who reads: a name as DICOM writes it, family name first, parts separated by ^
             * @example Doe^Jane^^Dr.
             */
            reader?: string;
            /** @description Id of the volume at rest of the comparison that is read */
            rest?: string;
            /** @description Scores of the 17 segments at rest */
            rest_scores?: number[];
            /** @description Id of the comparison, segmentation or beat that is read */
            result?: string;
            /** @description Scores of the 17 segments of a single scan in their order, 0 (normal) to 4 (no uptake) */
            scores?: number[];
            /** @description Scores of the 17 segments at stress */
            stress_scores?: number[];
        };
        /** @description A reading. Everything but `scores` and `flags` is as the reader stated it. */
        ReadingReport: {
            /** @description Id of the reading that this one replaces. */
            amends?: string | null;
            /** @description Flags of the result that was read. */
            flags: components["schemas"]["Flag"][];
            /** @description The impression. */
            impression?: string | null;
            /** @description Its kind. */
            kind: components["schemas"]["ReadKind"];
            /** @description What limits the study. */
            limits?: string | null;
            /** @description `good`, `fair` or `poor`. */
            quality?: string | null;
            /** @description When, RFC 3339 in UTC. */
            read_at: string;
            /** @description Who read. */
            reader: string;
            /** @description Id of the result that was read. */
            result?: string | null;
            /** @description The scores of each scan that the reader scored. */
            scores: components["schemas"]["ReadScores"][];
            /**
             * Format: int32
             * @description What the segments' scores at stress exceed those at rest by, if both were scored.
             */
            sds?: number | null;
        };
        ReadingRequest: {
            /** @description The newest reading of the same result, which this one replaces; it is kept */
            amends?: string;
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The impression; it must not name the patient
             * @example No perfusion defect.
             */
            impression?: string;
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            /** @description What limits the study; it must not name the patient */
            limits?: string;
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description How good the study is: `good`, `fair` or `poor` */
            quality?: string;
            /**
             * @description Who read it: family name first, parts separated by ^ as in DICOM
             * @example Doe^Jane^^Dr.
             */
            reader: string;
            /** @description Scores of the 17 segments at rest */
            rest_scores?: number[];
            /** @description The comparison, segmentation or beat that was read */
            result: string;
            /** @description Scores of the 17 segments of a single scan, 0 (normal) to 4 (no uptake) */
            scores?: number[];
            /** @description DICOM objects of the result that are sent to an archive */
            send?: "measurements.dcm"[];
            /** @description Scores of the 17 segments at stress */
            stress_scores?: number[];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description The main statements of a reading; the report has all. */
        ReadingSummary: {
            /** @description Id of the reading that this one replaces. */
            amends?: string | null;
            /** @description `good`, `fair` or `poor`. */
            quality?: string | null;
            /** @description When, RFC 3339 in UTC. */
            read_at: string;
            /** @description Who read. */
            reader: string;
            /** @description Id of the result that was read. */
            result?: string | null;
            /**
             * Format: int32
             * @description Summed difference score.
             */
            sds?: number | null;
            /**
             * Format: int32
             * @description Summed rest score.
             */
            srs?: number | null;
            /**
             * Format: int32
             * @description Summed stress score, or that of the only scan.
             */
            sss?: number | null;
        };
        /** @description Whether the service can accept work. */
        Ready: {
            /** @description Parts that the service depends on. */
            checks: components["schemas"]["Dependency"][];
            /**
             * @description Always `ok`.
             * @example ok
             */
            status: string;
            /** @description The program's version. */
            version: string;
        };
        /**
         * @description The receipt of an erasure. It stays when what it names is gone, and holds no name that was given
         *     to an item.
         */
        Receipt: {
            /** @description The AuditEvent that records it. */
            audit_event: components["schemas"]["AuditEventName"];
            /**
             * Format: date-time
             * @description When it was erased (RFC 3339).
             */
            erased_at: string;
            /** @description The name of the key that asked for it; `retention` if it had reached its age. */
            erased_by: string;
            /**
             * @description The receipt's id.
             * @example ers_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f
             */
            id: string;
            /**
             * @description The item that was to be erased: its id, that of what was received, or the UID of a work item; `volumes` if volumes were
             *     selected by a filter.
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            item: string;
            /** @description The item, and what went with it. */
            items: components["schemas"]["ErasedItem"][];
            /** @description The jobs whose records went with it. */
            jobs: string[];
            /** @description Related paths. */
            links: components["schemas"]["ReceiptLinks"];
            /** @description Why it was erased. */
            reason: components["schemas"]["ErasureReason"];
            /** @description By what volumes were selected, such as `study`; never a value. */
            selected_by?: string[];
        };
        /** @description Paths of one receipt. */
        ReceiptLinks: {
            /** @description This receipt. */
            self: string;
        };
        /** @description A page of receipts. */
        ReceiptList: {
            /** @description The receipts, newest first. */
            erasures: components["schemas"]["Receipt"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /** @description Objects that make up one volume. */
        Received: {
            /**
             * Format: date-time
             * @description When it last changed (RFC 3339).
             */
            changed_at: string;
            /**
             * Format: date-time
             * @description When its first object came (RFC 3339).
             */
            created_at: string;
            error?: components["schemas"]["Problem"] | null;
            /**
             * @description Its id.
             * @example rcv_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f
             */
            id: string;
            /** @description The values of Image Type. */
            image_type: string[];
            /** @description SOP Instance UID of an object that is a volume of its own; absent for a series of slices. */
            instance?: string | null;
            /** @description The job that a rule started. */
            job?: string | null;
            /** @description Related paths. */
            links: components["schemas"]["ReceivedLinks"];
            /** @description Modality. */
            modality?: string | null;
            /**
             * Format: int64
             * @description Number of its objects.
             */
            objects: number;
            /**
             * @description How its last object came: `c-store` or `stow-rs`.
             * @example c-store
             */
            protocol: string;
            /** @description The AE title, or the name of the key, that sent its last object. */
            sender: string;
            /** @description Series Instance UID. */
            series: string;
            /** @description How far it has come. */
            state: components["schemas"]["ReceivedState"];
            /** @description Study Instance UID. */
            study: string;
            /** @description The volume made of it. */
            volume?: string | null;
            /**
             * Format: int64
             * @description Size of those that are not part of a volume, bytes.
             */
            waiting_bytes: number;
        };
        /** @description Paths of received objects. */
        ReceivedLinks: {
            /** @description The job. */
            job?: string | null;
            /** @description This entry; DELETE forgets it. */
            self: string;
            /** @description The volume. */
            volume?: string | null;
        };
        /** @description A page of what was received. */
        ReceivedList: {
            /** @description The entries, newest first. */
            intake: components["schemas"]["Received"][];
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
        };
        /**
         * @description What became of received objects.
         * @enum {string}
         */
        ReceivedState: "gathering" | "filing" | "stored" | "failed";
        /** @description What is being received from other systems. */
        Receiving: {
            /**
             * Format: int64
             * @description Size of these, bytes.
             */
            bytes: number;
            /**
             * Format: int64
             * @description Number of their objects that have arrived.
             */
            objects: number;
            /**
             * Format: int64
             * @description Number of series, and of objects that are volumes of their own, of which objects still arrive or are being read.
             */
            series: number;
        };
        /** @description A delivery that is tried again. */
        Redelivered: components["schemas"]["Delivery"] | components["schemas"]["ObjectDelivery"];
        /** @description A model that could not be fitted. */
        RefusedTemplate: {
            /** @description Why. */
            reason: string;
            /** @description The model's name. */
            template: string;
        };
        /** @description Full width at half maximum of the image's point response. */
        Resolution: {
            /** @description `given` as a parameter, or `estimated` from the image. */
            source: string;
            /**
             * Format: double
             * @description Millimetres.
             */
            value: number;
        };
        /** @description Figures of the mesh before optimisation. */
        RetileReport: {
            /**
             * Format: int64
             * @description Attempts until the mesh was a manifold.
             */
            attempts: number;
            /**
             * Format: int64
             * @description Rounds of relaxation.
             */
            relaxation_rounds: number;
            /**
             * Format: int64
             * @description Repetitions of repulsion and tessellation.
             */
            repeats: number;
            /**
             * Format: int64
             * @description Rounds of repulsion.
             */
            repulsion_rounds: number;
            /**
             * Format: int64
             * @description Seed of the kept model's random numbers.
             */
            seed: number;
            /** @description Shape of the triangles. */
            shape: components["schemas"]["Shape"];
            /** @description Angles between neighbouring triangles. */
            smoothness: components["schemas"]["Smoothness"];
            /** @description The models of which the best was kept. */
            starts: components["schemas"]["Start"][];
        };
        /** @description The keys that were revoked. */
        RevokedKeys: {
            /**
             * @description Their ids; those that had been revoked before are none of them.
             * @example [
             *       "0123456789abcdef"
             *     ]
             */
            revoked: string[];
        };
        /** @description intensity = slope × stored value + intercept. */
        Scaling: {
            /**
             * Format: double
             * @description The intercept.
             */
            intercept: number;
            /**
             * Format: double
             * @description The slope.
             */
            slope: number;
        };
        /** @description Whose scan a volume is: what its DICOM header says, or was stated. */
        Scan: {
            /** @description Accession Number (0008,0050). */
            accession_number?: string | null;
            /**
             * @description Acquisition Date (0008,0022), or the date in Acquisition `DateTime` (0008,002A), or
             *     the Series Date, `YYYYMMDD`.
             */
            acquisition_date?: string | null;
            /** @description Acquisition Time (0008,0032), or the time in Acquisition `DateTime` (0008,002A). */
            acquisition_time?: string | null;
            /** @description Convolution Kernel (0018,1210). */
            convolution_kernel?: string | null;
            /** @description Corrected Image (0028,0051), values separated by backslashes: with `ATTN` attenuation was corrected. */
            corrected_image?: string | null;
            /** @description Frame of Reference UID (0020,0052). */
            frame_of_reference_uid?: string | null;
            /** @description Image Type (0008,0008), values separated by backslashes. */
            image_type?: string | null;
            /**
             * @description Radionuclide Total Dose (0018,1074) as stored: MBq in NM images, Bq in PET images
             *     ([`Provenance::injected_dose_mbq`]).
             */
            injected_dose?: string | null;
            /** @description Radiopharmaceutical Start Time (0018,1072). */
            injection_time?: string | null;
            /** @description SOP Instance UIDs of a series of several instances; in `/identity` only. */
            instance_uids?: string[];
            /** @description Manufacturer (0008,0070) of the equipment. */
            manufacturer?: string | null;
            /** @description Modality (0008,0060). */
            modality?: string | null;
            /** @description Manufacturer's Model Name (0008,1090). */
            model_name?: string | null;
            /** @description Patient's Birth Date (0010,0030), `YYYYMMDD`. */
            patient_birth_date?: string | null;
            /** @description Patient ID (0010,0020). */
            patient_id?: string | null;
            /** @description Patient's Name (0010,0010), components separated by `^`. */
            patient_name?: string | null;
            /** @description Patient Position (0018,5100), such as `HFS`, or the meaning of the Patient Orientation Modifier Code (0054,0412). */
            patient_position?: string | null;
            /** @description Patient's Sex (0010,0040): `M`, `F` or `O`. */
            patient_sex?: string | null;
            /** @description Position Reference Indicator (0020,1040). */
            position_reference_indicator?: string | null;
            /** @description Protocol Name (0018,1030). */
            protocol_name?: string | null;
            /** @description Meaning of the Radionuclide Code (0054,0300). */
            radionuclide?: string | null;
            /**
             * @description Meaning of the Radiopharmaceutical Code (0054,0304), or the Radiopharmaceutical
             *     (0018,0031).
             */
            radiopharmaceutical?: string | null;
            /** @description Reconstruction Method (0054,1103). */
            reconstruction_method?: string | null;
            /** @description Referring Physician's Name (0008,0090). */
            referring_physician?: string | null;
            /** @description `rest` or `stress`. */
            rest_or_stress?: string | null;
            /** @description Scan Arc (0018,1143): by how many degrees the camera turned. */
            scan_arc?: string | null;
            /** @description Series Description (0008,103E). */
            series_description?: string | null;
            /** @description Series Number (0020,0011). */
            series_number?: string | null;
            /** @description Series Instance UID (0020,000E). */
            series_uid?: string | null;
            /** @description Software Versions (0018,1020). */
            software_versions?: string | null;
            /** @description SOP Class UID (0008,0016) of the instances. */
            sop_class_uid?: string | null;
            /** @description SOP Instance UID (0008,0018); of a series of several instances, the first one's. */
            sop_instance_uid?: string | null;
            /** @description Study Date (0008,0020), `YYYYMMDD`. */
            study_date?: string | null;
            /** @description Study Description (0008,1030). */
            study_description?: string | null;
            /** @description Study ID (0020,0010). */
            study_id?: string | null;
            /** @description Study Time (0008,0030), `HHMMSS.FFFFFF`. */
            study_time?: string | null;
            /** @description Study Instance UID (0020,000D). */
            study_uid?: string | null;
            /**
             * @description Fields that the file states and that cannot be decoded; while they belong to patient or
             *     study, no DICOM object is made.
             */
            undecoded?: string[];
            /** @description Units (0054,1001). */
            units?: string | null;
        };
        /** @description Study, series and Frame of Reference of a scan. */
        ScanUids: {
            /**
             * @description Frame of Reference UID.
             * @example 1.2.840.99999.1.3
             */
            frame_of_reference_uid?: string | null;
            /**
             * @description Series Instance UID.
             * @example 1.2.840.99999.1.2
             */
            series_uid?: string | null;
            /**
             * @description Study Instance UID.
             * @example 1.2.840.99999.1.1
             */
            study_uid?: string | null;
        };
        /**
         * @description What a key allows.
         * @enum {string}
         */
        Scope: "read" | "submit" | "sign" | "admin";
        /** @description A segment through the beat. */
        SegmentMotionReport: {
            /**
             * Format: double
             * @description Motion of the inner surface inward, end diastole to end systole.
             */
            motion_mm: number;
            /** @description Its name. */
            name: string;
            /**
             * Format: double
             * @description Phase of the greatest thickness; `null` where the segment does not move.
             */
            phase_degrees?: number | null;
            /**
             * Format: int64
             * @description Its number, 1 to 17.
             */
            segment: number;
            /**
             * Format: double
             * @description The same by the counts of the wall, a second opinion: lower by what the image's filter takes; `null` where the
             *     wall has no counts.
             */
            thickening_counts_percent?: number | null;
            /**
             * Format: double
             * @description Thickening, end diastole to end systole.
             */
            thickening_percent: number;
        };
        /** @description A segment beside its limits. */
        SegmentScore: {
            /**
             * Format: double
             * @description Share of its area that has limits and muscle.
             */
            compared_percent: number;
            /**
             * Format: double
             * @description Mean score of its wall, per cent of the greatest.
             */
            deficit_percent: number;
            /**
             * Format: double
             * @description Share of its wall below the limit.
             */
            extent_percent: number;
            /** @description Its name. */
            name: string;
            /**
             * Format: int32
             * @description Score, 0 to 4.
             */
            score?: number | null;
            /**
             * Format: int64
             * @description Its number, 1 to 17.
             */
            segment: number;
            /**
             * Format: double
             * @description Mean of z: standard deviations from the normal mean, negative below; null where nothing can be compared.
             */
            z?: number | null;
        };
        /** @description A segmentation: a model fitted to a volume, with its main figures and its reliability. */
        Segmentation: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example seg_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["SegmentationLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["SegmentationParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description The chosen model and the merit of every candidate, why the fit stopped, its confidence, volumes, agreement with the expert's mask, and warnings; the report has all figures. */
            summary: components["schemas"]["SegmentationSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        /** @enum {string} */
        SegmentationFileName: "mesh.glb" | "mesh.gltf" | "mesh.stl" | "mesh.ply" | "mesh.obj" | "mesh.vtp" | "mesh.vtk" | "mesh.json" | "mesh_anatomical.glb" | "mesh_anatomical.gltf" | "mesh_anatomical.stl" | "mesh_anatomical.ply" | "mesh_anatomical.obj" | "mesh_anatomical.vtp" | "mesh_anatomical.vtk" | "mesh_anatomical.json" | "mesh_apparent.glb" | "mesh_apparent.gltf" | "mesh_apparent.stl" | "mesh_apparent.ply" | "mesh_apparent.obj" | "mesh_apparent.vtp" | "mesh_apparent.vtk" | "mesh_apparent.json" | "mask.nii.gz" | "mask_anatomical.nii.gz" | "mask_apparent.nii.gz" | "labels.nii.gz" | "labels.seg.nrrd" | "report.json" | "report.html" | "slices.png" | "region.nii.gz" | "projections.png" | "polar.json" | "polar.svg" | "polar.png" | "polar_z.json" | "polar_z.svg" | "polar_z.png" | "polar_score.json" | "polar_score.svg" | "polar_score.png" | "mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm" | "measurements.dcm" | "polar.dcm" | "page.dcm" | "fhir.json";
        SegmentationForm: {
            /**
             * Format: binary
             * @description An expert's mask (above 0.5) to measure against
             */
            expert?: string;
            /**
             * Format: binary
             * @description The volume; several files make up one
             */
            volume: string;
        };
        SegmentationJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "segmentation";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["SegmentationParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm" | "measurements.dcm" | "polar.dcm" | "page.dcm")[];
            source?: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one segmentation. */
        SegmentationLinks: {
            /** @description DICOM objects of the scan's patient and study, for the archive. */
            dicom: string[];
            /** @description The mask on the volume's grid. */
            mask: string;
            /** @description The fitted mesh, in the format that `Accept` asks for. */
            mesh: string;
            /** @description The report as an HTML page. */
            page: string;
            /** @description The polar map; left ventricles only. */
            polar?: string | null;
            /** @description The report. */
            report: string;
            /** @description This segmentation. */
            self: string;
            /** @description The volume. */
            volume: string;
        };
        /** @description A page of segmentations. */
        SegmentationList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The segmentations, newest first. */
            segmentations: components["schemas"]["Segmentation"][];
        };
        /** @description The parameters of a segmentation */
        SegmentationParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description Whether the scan's attenuation was corrected, which chooses the group of the normal limits. Default: what a DICOM header says
             * @enum {string}
             */
            attenuation_corrected?: "yes" | "no";
            /** @description Direction from base to apex, x,y,z in LPS, of any length: the search stays within 35 degrees of it */
            axis?: number[];
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /** @description A point of the ventricle's base, x,y,z in LPS millimetres: the rim of the wall is put there (moved by at most 20 mm towards the apex or 40 mm away from it). Default: where image and anatomy put it */
            base?: number[];
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /** @description Box of voxels that contains the centre of the organ: i0,j0,k0,i1,j1,k1, counted from 0, both corners included */
            box?: number[];
            /** @description A point in the cavity, x,y,z in LPS millimetres: the search stays within 25 mm of it and does not question it. Default: the organ is searched for in the whole volume */
            center?: number[];
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /**
             * @description Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) or anatomical (the wall itself, without the thickness that blur adds). The report has the volumes of both
             * @default apparent
             * @enum {string}
             */
            edge?: "apparent" | "anatomical";
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /** @description Id of a volume with an expert's mask to compare with: a mask, a label map, a DICOM Segmentation, probabilities of which those above 0.5 count, or a closed mesh (STL, PLY, OBJ, VTK, VTP, glTF) */
            expert?: string;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /** @description Frame of a 4-D volume or gate, counted from 0 (0 is the first); without it, the gates of a heart beat are summed */
            frame?: number;
            /** @description Points that the wall's inner surface, as it looks in the image, passes through: x,y,z in LPS millimetres, one point after the other. About each, the image's own edge is not followed */
            inner_through?: number[];
            /**
             * @description Name (as in a report) of the fitted model to keep: a correction by the position, the axis or the base then keeps its heart. Default: the one with the greatest confidence
             * @example built-in usual
             */
            kept_model?: string;
            /**
             * @description Structure of the expert's mask, if the file has several: the number of a label or segment, or the name or code of a segment. Default: the only one; of segments, the one coded as myocardium
             * @example 2, or the name of a DICOM segment
             */
            label?: string;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Grid of the masks and labels that are written: scan (the scan's own) or orthogonal (of a scan whose axes are not at right angles, as of a tilted gantry, a grid at right angles that covers it; NIfTI's qform and ITK know no other)
             * @default scan
             * @enum {string}
             */
            mask_grid?: "scan" | "orthogonal";
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Frame of an expert's mask that is a mesh: lps (DICOM, x to the left, y to posterior) or ras (NIfTI, x to the right, y to anterior). Default: what its file states (SPACE=LPS, SPACE=RAS); otherwise lps
             * @enum {string}
             */
            mesh_frame?: "lps" | "ras";
            /**
             * @description Unit of an expert's mask that is a mesh. Default: what its file states; otherwise mm (of glTF m), if the size is that of an organ
             * @enum {string}
             */
            mesh_unit?: "mm" | "cm" | "m";
            /**
             * @description Id of the model to fit (a template, a model or an earlier segmentation), or auto: fits the built-in hearts, the templates flagged `library` and the models named after it (auto,tpl_12,mdl_34), and keeps the fit with the greatest confidence. Alternative name: template
             * @default auto
             */
            model?: string;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /** @description Id of normal limits to compare the wall's uptake with */
            normals?: string;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Organ that the model shows. All but the left ventricle are searched for as the largest bright region and have no polar map
             * @default left_ventricle
             * @enum {string}
             */
            organ?: "left_ventricle" | "liver" | "kidney" | "generic";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /** @description Points that the wall's outer surface passes through, likewise */
            outer_through?: number[];
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description The scan's protocol, as the normal limits name it. Default: the only one that they have
             * @example rest
             */
            protocol?: string;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /** @description Id of a reader's profile to draw the wall by: moves the endocardium, the epicardium and the rim by the distances that `ventriform calibrate` learnt from that reader's masks. Its edge must be that of `edge`. Default: the wall as it was fitted */
            reader?: string;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /**
             * @description Whether an expert's mask on another grid of voxels is resampled by the nearest voxel; without it, such a mask is refused
             * @default false
             */
            resample?: boolean;
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /** @description Voxel i,j,k (counted from 0) in the cavity; use this or center */
            seed_point?: number[];
            /** @description Direction from the long axis to the wall that segments are counted from as the anterior one, x,y,z in the LPS frame of the volume, once the fit is done: heart and wall stay, names of places change. Default: the anterior wall by `superior` or `anterior`, which the fit starts from */
            segments_from?: number[];
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description The patient's sex, which chooses the group of the normal limits. Default: that of a DICOM header
             * @enum {string}
             */
            sex?: "F" | "M";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
            /**
             * @description The scan's tracer, as the normal limits name it. Default: the one that a DICOM header's text names, or the only one that they have
             * @example Tc-99m tetrofosmin
             */
            tracer?: string;
        };
        /** @description The report of a segmentation. Lengths are millimetres in the patient frame LPS. */
        SegmentationReport: {
            /** @description Models that were fitted. */
            candidates: components["schemas"]["Candidate"][];
            /** @description Why that one was taken. */
            choice: string;
            evidence?: components["schemas"]["Evidence"] | null;
            /** @description Figures of the fit. */
            fit: components["schemas"]["Fit"];
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /** @description Sentences that a reader may take over into the impression; `null` where the report was made before they existed. */
            impression?: string[] | null;
            /** @description The volume's file. */
            input: components["schemas"]["FileFacts"];
            localisation?: components["schemas"]["Localisation"] | null;
            /** @description Which voxels the mask holds. */
            mask_rule: string;
            /**
             * Format: double
             * @description Mass of the myocardium, g, from the anatomical wall; ventricles only.
             */
            mass_g?: number | null;
            /** @description Of nine of ten hearts, the true mass lies within these, g; ventricles only. */
            mass_interval_g?: number[] | null;
            measures?: components["schemas"]["Agreement"] | null;
            /** @description Every parameter, defaults written out. */
            parameters: components["schemas"]["SegmentationParameters"];
            perfusion?: components["schemas"]["Perfusion"] | null;
            polar?: components["schemas"]["PolarSummary"] | null;
            posture?: components["schemas"]["Posture"] | null;
            projections?: components["schemas"]["ProjectionsReport"] | null;
            reader?: components["schemas"]["AppliedReader"] | null;
            /** @description Models that could not be fitted. */
            refused: components["schemas"]["RefusedTemplate"][];
            resolution_mm?: components["schemas"]["Resolution"] | null;
            /** @description Name of the fitted model. */
            template: string;
            thickness_mm?: components["schemas"]["Thicknesses"] | null;
            uncertainty_mm?: components["schemas"]["Uncertainties"] | null;
            /** @description Volumes. */
            volumes_ml: components["schemas"]["FittedVolumes"];
            /**
             * Format: double
             * @description Mean thickness of the wall that `edge` asks for; ventricles only.
             */
            wall_thickness_mm?: number | null;
            /** @description Warnings about the volume's file. */
            warnings: string[];
        };
        /** @description The main figures of a segmentation; the report has all. */
        SegmentationSummary: {
            /** @description Models that were fitted. */
            candidates: components["schemas"]["Candidate"][];
            /** @description Why that one was taken. */
            choice: string;
            /**
             * Format: double
             * @description Confidence that the fit is right, 0 to 1.
             */
            confidence: number;
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            measures?: components["schemas"]["Agreement"] | null;
            /** @description Why the motion ended. */
            reason: string;
            /** @description Name of the fitted model. */
            template: string;
            /**
             * Format: int64
             * @description Number of vertices of the fitted mesh.
             */
            vertices: number;
            /** @description Volumes. */
            volumes_ml: components["schemas"]["FittedVolumes"];
        };
        /**
         * @description A serial comparison: scans of one patient, fitted from one common heart, with the main figures. Its volume is the
         *     first scan of the request, its parameter `others` the others.
         */
        Serial: {
            /**
             * Format: date-time
             * @description When it was made (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["ScanUids"] | null;
            /**
             * Format: date-time
             * @description When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
             * @example ser_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Related paths. */
            links: components["schemas"]["SerialLinks"];
            /** @description The parameters used, including every default. */
            parameters: components["schemas"]["SerialParameters"];
            /** @description The program that made it. */
            software: components["schemas"]["Software"];
            /** @description What changed from the first to the last scan, and flags; the report has all figures. */
            summary: components["schemas"]["SerialSummary"];
            /** @description The volume it was made of. */
            volume: string;
        };
        SerialFileName: ("mesh_scan01.glb" | "mesh_scan01.gltf" | "mesh_scan01.stl" | "mesh_scan01.ply" | "mesh_scan01.obj" | "mesh_scan01.vtp" | "mesh_scan01.vtk" | "mesh_scan01.json" | "serial.json" | "report.html" | "trend.svg" | "figures.csv" | "changes.csv" | "segments.csv" | "measurements.dcm" | "fhir.json") | string;
        SerialJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "serial";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["SerialParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: "measurements.dcm"[];
            source?: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one serial comparison. */
        SerialLinks: {
            /** @description DICOM objects of the study of the last scan, for the archive. */
            dicom: string[];
            /** @description The wall in the first scan, in the format that `Accept` asks for. */
            mesh: string;
            /** @description The report as an HTML page. */
            page: string;
            /** @description The report. */
            report: string;
            /** @description This serial comparison. */
            self: string;
            /** @description The figures of all scans, drawn. */
            trend: string;
            /** @description The volumes, in the order of the request. */
            volumes: string[];
        };
        /** @description A page of serials. */
        SerialList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The serials, newest first. */
            serials: components["schemas"]["Serial"][];
        };
        /**
         * @description The change of the wall's uptake from an earlier to a later scan. Uptake is in per cent of the earlier scan's reference,
         *     the later one scaled to it by the wall that did not change.
         */
        SerialPair: {
            /** @description Its interval. */
            better_interval_percent: number[];
            /**
             * Format: double
             * @description Share of the wall that gained uptake.
             */
            better_percent: number;
            /** @description Whether wall gained uptake. */
            better_verdict: components["schemas"]["Verdict"];
            /**
             * Format: double
             * @description Share of the wall with muscle in both scans.
             */
            compared_percent: number;
            /**
             * Format: double
             * @description Correlation of both maps.
             */
            correlation: number;
            /**
             * Format: double
             * @description Share of the wall below the threshold in both scans.
             */
            dark_in_both_percent: number;
            /**
             * Format: double
             * @description The least loss, per cent, that is found in nine of ten such pairs if it takes up a territory.
             */
            detectable_percent: number;
            /**
             * Format: int64
             * @description The earlier scan.
             */
            earlier: number;
            /**
             * Format: int64
             * @description The later one.
             */
            later: number;
            /**
             * Format: double
             * @description What the later scan lacks in the regions that lost uptake, per cent of the whole wall's uptake.
             */
            lost_percent: number;
            /**
             * Format: double
             * @description Share of the wall by which the later scan was scaled.
             */
            matched_percent: number;
            /**
             * Format: double
             * @description Standard deviation of the smoothed difference by the noise of this pair, points.
             */
            noise_points: number;
            /**
             * Format: double
             * @description Counts of the later scan that are one count of the earlier one where nothing changed.
             */
            scale: number;
            /** @description The 17 segments. */
            segments: components["schemas"]["SerialSegment"][];
            /** @description Its interval by noise: 5th and 95th percentile. */
            worse_interval_percent: number[];
            /**
             * Format: double
             * @description Share of the wall that lost uptake, each region as far as half of the depth of its loss.
             */
            worse_percent: number;
            /** @description Whether wall lost uptake. */
            worse_verdict: components["schemas"]["Verdict"];
        };
        /** @description The parameters of a serial comparison */
        SerialParameters: {
            /** @description Direction from the long axis to the anterior wall, x,y,z in the LPS frame of the volume: where segments are counted from if no superior direction is stated, as in short-axis slices (there, often 0,-1,0: the top of the picture) */
            anterior?: number[];
            /**
             * @description Whether the scan's attenuation was corrected, which chooses the group of the normal limits. Default: what a DICOM header says
             * @enum {string}
             */
            attenuation_corrected?: "yes" | "no";
            /**
             * @description How far the axis of rotation lies from the middle of the frames towards higher columns, mm
             * @default 0
             */
            axis_offset_mm?: number;
            /**
             * @description Sigma of the Gaussian that smooths the image for the sensors, millimetres
             * @default 3
             */
            blur?: number;
            /**
             * @description Stiffness that keeps the shape of the whole model, square millimetres
             * @default 6
             */
            body_stiffness?: number;
            /**
             * @description Whether views of projections in which the heart lies elsewhere are shifted back, and slices and fit are made again. Reports state the motion and both results
             * @default false
             */
            correct_motion?: boolean;
            /**
             * @description Damping of the motion per time step
             * @default 1
             */
            damping?: number;
            /**
             * @description Wall of a ventricle that mask, mesh and measures show: apparent (as the blurred image shows it) or anatomical (the wall itself, without the thickness that blur adds). The report has the volumes of both
             * @default apparent
             * @enum {string}
             */
            edge?: "apparent" | "anatomical";
            /** @description Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of the radionuclide */
            energy_window?: number;
            /**
             * @description What keeps noise out of the image: butterworth, gaussian or none
             * @default butterworth
             * @enum {string}
             */
            filter?: "butterworth" | "gaussian" | "none";
            /**
             * @description Frequency of which the Butterworth filter leaves 71 %, cycles per cm
             * @default 0.5
             */
            filter_cut_off_per_cm?: number;
            /**
             * @description Width of the Gaussian filter at half of its maximum, mm
             * @default 10
             */
            filter_fwhm_mm?: number;
            /**
             * @description Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f
             * @default 5
             */
            filter_order?: number;
            /**
             * @description Whether the volumes of all files are gates of one heart beat although their headers say otherwise
             * @default false
             */
            gated?: boolean;
            /**
             * @description Name (as in a report) of the fitted model to keep: a correction by the position, the axis or the base then keeps its heart. Default: the one with the greatest confidence
             * @example built-in usual
             */
            kept_model?: string;
            /**
             * @description Final search range of the sensors, millimetres to either side
             * @default 6
             */
            last_reach?: number;
            /**
             * @description How far outside the detected edge the contour is drawn, millimetres
             * @default 0
             */
            margin?: number;
            /**
             * @description Mass of the whole model relative to a sensor force of 1 per millimetre
             * @default 0.1
             */
            mass?: number;
            /** @description Mass of the left ventricle's muscle, g, where it is known, as by magnetic resonance: the image hardly tells how thick a wall is. Default: by the wall's width, with the interval that it leaves */
            mass_g?: number;
            /**
             * @description Maximum number of time steps
             * @default 100
             */
            max_iterations?: number;
            /**
             * @description Id of the model to fit (a template, a model or an earlier segmentation), or auto: fits the built-in hearts, the templates flagged `library` and the models named after it (auto,tpl_12,mdl_34), and keeps the fit with the greatest confidence. Alternative name: template
             * @default auto
             */
            model?: string;
            /**
             * @description Factor by which the search range shrinks from step to step
             * @default 0.85
             */
            narrowing?: number;
            /** @description Id of normal limits to compare the wall's uptake with */
            normals?: string;
            /**
             * @description Arc of the camera's rotation, degrees: 180, 360, or none (a stationary camera: motion does not show in the image and is not flagged). auto: as a DICOM header says (Scan Arc (0018,1143); PET: none); where it does not, motion is flagged only from a chance of one half on
             * @default auto
             * @enum {string}
             */
            orbit?: "auto" | "none" | "180" | "360";
            /**
             * @description Iterations of OSEM over all subsets; more sharpen the image and its noise
             * @default 3
             */
            osem_iterations?: number;
            /**
             * @description Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less than half of it
             * @default 10
             */
            osem_subsets?: number;
            /** @description Ids of the volumes of the patient's other scans, separated by commas */
            others?: string;
            /**
             * @description Sigma of the Gaussian that smooths the image for the polar map, millimetres
             * @default 3
             */
            polar_blur?: number;
            /**
             * @description How far the samples of the polar map extend beyond the wall on both sides, millimetres
             * @default 3
             */
            polar_extension?: number;
            /**
             * @description How wide the levels of the polar map are drawn: standard (rings of equal width) or area (each level has the share of the map that it has of the wall)
             * @default standard
             * @enum {string}
             */
            polar_projection?: "standard" | "area";
            /**
             * @description Share of the wall's reference uptake below which a sample counts as a defect
             * @default 0.6
             */
            polar_threshold?: number;
            /**
             * @description The scan's protocol, as the normal limits name it. Default: the only one that they have
             * @example rest
             */
            protocol?: string;
            /**
             * @description Initial search range of the sensors, millimetres to either side
             * @default 10
             */
            reach?: number;
            /**
             * @description How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)
             * @default osem
             * @enum {string}
             */
            reconstruction?: "osem" | "fbp";
            /** @description Resolution of the image, if it is known: full width at half maximum of a point, including motion and filters, millimetres (ventriform resolution learns it from scans of a protocol). It tells how much of a wall's thickness is blur. Default: by the image's noise, less certain */
            resolution?: number;
            /**
             * @description Rotation of the model about the long axis, in degrees, in addition to the smallest rotation that aligns the axes
             * @default 0
             */
            roll?: number;
            /**
             * @description Whether all scans are of one patient although their headers name several, as after pseudonymisation
             * @default false
             */
            same_patient?: boolean;
            /**
             * @description What the sensors detect: half_maximum (the point half-way down the steepest outward fall), gradient (the steepest point of that fall), unsigned (the steepest change in either direction) or level (the crossing of half of the organ's uptake)
             * @default half_maximum
             * @enum {string}
             */
            sensor?: "half_maximum" | "gradient" | "unsigned" | "level";
            /**
             * @description The patient's sex, which chooses the group of the normal limits. Default: that of a DICOM header
             * @enum {string}
             */
            sex?: "F" | "M";
            /**
             * @description Stiffness that keeps the length of edges, square millimetres
             * @default 2.5
             */
            spring_stiffness?: number;
            /**
             * @description Which direction is superior in the patient, from which the segments of the polar map are counted: body (from the outline of the body, if enough of it is in view, else as the volume's frame states), frame (as the frame states) or the direction itself, x,y,z in the LPS frame of the volume
             * @default body
             * @example body
             * @example 0,0,1
             */
            superior?: string;
            /**
             * @description Stiffness that keeps the thickness of the wall
             * @default 0.02
             */
            thickness_stiffness?: number;
            /**
             * @description Length of one time step of the motion
             * @default 1
             */
            time_step?: number;
            /**
             * @description Largest displacement of a node per step at which the model counts as at rest, millimetres
             * @default 0.04
             */
            tolerance?: number;
            /**
             * @description Stiffness that keeps each node's position among its neighbours, square millimetres
             * @default 7.5
             */
            torsion_stiffness?: number;
            /**
             * @description The scan's tracer, as the normal limits name it. Default: the one that a DICOM header's text names, or the only one that they have
             * @example Tc-99m tetrofosmin
             */
            tracer?: string;
        };
        /** @description The report of a serial comparison: scans of one patient, and what changed from scan to scan. */
        SerialReport: {
            /** @description The change of every figure: of every scan against the first one, and then against the one before it. */
            changes: components["schemas"]["FigureChange"][];
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /** @description Whether all scans are gated, so that there are beats. */
            gated: boolean;
            /** @description The change of the wall's uptake, likewise. */
            pairs: components["schemas"]["SerialPair"][];
            /** @description Every parameter, defaults written out. */
            parameters: {
                [key: string]: unknown;
            };
            /** @description The scans, in the order of their dates. */
            scans: components["schemas"]["SerialScan"][];
        };
        SerialRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            /** @description Normal limits by which all scans are scored */
            normals?: string;
            parameters?: components["schemas"]["SerialParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description The scans, in any order: volumes, or the segmentations or beats of them */
            scans: string[];
            /** @description DICOM objects of the result that are sent to an archive */
            send?: "measurements.dcm"[];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description A scan of a series. All are fitted from one common heart. */
        SerialScan: {
            /**
             * Format: double
             * @description Beats a minute; `null` unless the scan is gated and its R-R interval is known.
             */
            beats_per_minute?: number | null;
            /**
             * Format: double
             * @description Volume of the cavity in the image of all gates.
             */
            cavity_ml?: number | null;
            /**
             * Format: double
             * @description Confidence of the fit of this scan alone, 0..=1.
             */
            confidence: number;
            /**
             * Format: double
             * @description Correlation of the image with that of the first scan about the wall.
             */
            correlation: number;
            /**
             * Format: double
             * @description Share of the wall below the threshold, a share of the scan's own maximum.
             */
            dark_percent?: number | null;
            /** @description The date, `YYYY-MM-DD`; `null` where the header states none. */
            date?: string | null;
            /**
             * Format: double
             * @description Deficit score.
             */
            deficit_percent?: number | null;
            /**
             * Format: double
             * @description End-diastolic volume.
             */
            edv_ml?: number | null;
            /**
             * Format: double
             * @description Ejection fraction, per cent; `null` unless all scans are gated, as for the others of the beat.
             */
            ef_percent?: number | null;
            /**
             * Format: double
             * @description End-systolic volume.
             */
            esv_ml?: number | null;
            /**
             * Format: double
             * @description Share of the wall below the normal limit; `null` without normal limits, as for the other two.
             */
            extent_percent?: number | null;
            /**
             * Format: int64
             * @description Its number as it was given.
             */
            given: number;
            /** @description The file. */
            input: components["schemas"]["FileFacts"];
            /**
             * Format: double
             * @description Mass of the muscle by the fit of this scan alone; the volumes of all scans stand on one common mass.
             */
            mass_g?: number | null;
            /**
             * Format: double
             * @description Inward motion, the mean of the segments.
             */
            motion_mm?: number | null;
            /**
             * Format: double
             * @description How far the heart lies from where it was in the first scan, mm.
             */
            moved_mm: number;
            /**
             * Format: int64
             * @description Its number.
             */
            number: number;
            /**
             * Format: double
             * @description Bandwidth of the phases.
             */
            phase_bandwidth_degrees?: number | null;
            /**
             * Format: double
             * @description Standard deviation of the phases; `null` where they are not reliable.
             */
            phase_sd_degrees?: number | null;
            polar?: components["schemas"]["PolarSummary"] | null;
            resolution_mm?: components["schemas"]["Resolution"] | null;
            /** @description Series Description, if the header has one. */
            series_description?: string | null;
            /**
             * Format: double
             * @description Summed score, 0 to 68.
             */
            summed_score?: number | null;
            /** @description The model that was fitted. */
            template: string;
            /**
             * Format: double
             * @description Thickening, the mean of the segments.
             */
            thickening_percent?: number | null;
            /**
             * Format: double
             * @description By how much it is turned against the first scan, degrees.
             */
            turned_degrees: number;
            /** @description Warnings about the file. */
            warnings: string[];
        };
        /** @description The change of a segment from an earlier to a later scan. */
        SerialSegment: {
            /** @description Its 95 % interval. */
            change_interval_points?: number[] | null;
            /**
             * Format: double
             * @description The later less the earlier, points.
             */
            change_points?: number | null;
            change_verdict?: components["schemas"]["Verdict"] | null;
            /**
             * Format: double
             * @description Its mean uptake in the earlier scan; `null` where nothing can be compared, as for the others.
             */
            earlier_percent?: number | null;
            /**
             * Format: double
             * @description In the later one.
             */
            later_percent?: number | null;
            /**
             * Format: double
             * @description Change of the inward motion, mm; `null` unless all scans are gated.
             */
            motion_change_mm?: number | null;
            /** @description Its name. */
            name: string;
            /**
             * Format: int64
             * @description Its number, 1 to 17.
             */
            segment: number;
            /**
             * Format: double
             * @description Change of the thickening, points.
             */
            thickening_change_points?: number | null;
        };
        /** @description The main figures of a serial comparison, of its last scan against the first one; the report has all. */
        SerialSummary: {
            /**
             * Format: double
             * @description Share of the wall that gained uptake.
             */
            better_percent: number;
            /** @description Whether wall gained uptake. */
            better_verdict: components["schemas"]["Verdict"];
            /**
             * Format: double
             * @description The least confidence of the fits, 0 to 1.
             */
            confidence: number;
            /**
             * Format: double
             * @description Change of the ejection fraction, points; `null` unless all scans are gated.
             */
            ef_change_points?: number | null;
            ef_change_verdict?: components["schemas"]["Verdict"] | null;
            /** @description Reasons to look closer. */
            flags: components["schemas"]["Flag"][];
            /**
             * Format: int64
             * @description Number of scans.
             */
            scans: number;
            /**
             * Format: double
             * @description Share of the wall that lost uptake.
             */
            worse_percent: number;
            /** @description Whether wall lost uptake. */
            worse_verdict: components["schemas"]["Verdict"];
        };
        /**
         * @description A patient's sex, as the scan's header has it.
         * @enum {string}
         */
        Sex: "F" | "M";
        /** @description Figures of the triangles' shapes. */
        Shape: {
            /** @description Areas of triangles, mm². */
            area_mm2: components["schemas"]["Summary"];
            /** @description Lengths of edges, mm. */
            edge_length_mm: components["schemas"]["Summary"];
            /** @description Largest angle of each triangle, degrees. */
            max_angle_deg: components["schemas"]["Summary"];
            /** @description Smallest angle of each triangle, degrees, 60 = equilateral. */
            min_angle_deg: components["schemas"]["Summary"];
            /** @description Radius ratio 2r/R, 1 = equilateral. */
            radius_ratio: components["schemas"]["Summary"];
            /** @description Edges at each vertex. */
            valence: components["schemas"]["Valence"];
        };
        /** @description Figures of the mesh's smoothness. */
        Smoothness: {
            /** @description Angle between the normals of neighbouring triangles, degrees, 0 = flat. */
            dihedral_deg: components["schemas"]["Summary"];
        };
        /** @description The program that made a product. */
        Software: {
            /** @description The program. */
            name: string;
            /** @description Its version. */
            version: string;
        };
        SourceJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work
             * @default model
             * @enum {string}
             */
            kind?: "model" | "segmentation" | "beat" | "comparison" | "serial" | "normals";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["JobParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm" | "measurements.dcm" | "polar.dcm" | "page.dcm" | "mask_ed.dcm" | "mask_es.dcm" | "polar_stress.dcm" | "polar_rest.dcm" | "polar_difference.dcm")[];
            source: components["schemas"]["SourceRequest"];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description A series in an archive. */
        SourceRequest: {
            /**
             * @description Name of a configured archive
             * @example pacs
             */
            archive?: string;
            /**
             * @description Base URL of a DICOMweb service, instead of `archive`: of a configured archive, or of a host that the operator has
             *     allowed
             */
            dicomweb?: string;
            /** @description Series Instance UID */
            series: string;
            /** @description Study Instance UID */
            study: string;
        };
        /** @description The people of a group, each judged by the limits of the others. */
        Specificity: {
            /** @description Each person's figures. */
            cases: components["schemas"]["LeftOut"][];
            /**
             * Format: double
             * @description The deficit score that 95 of 100 people stay below, per cent: quantile of 95 per cent.
             */
            deficit_percent_of_95: number;
            /**
             * Format: double
             * @description Mean deficit score, per cent.
             */
            mean_deficit_percent: number;
            /**
             * Format: double
             * @description Mean share of the wall beyond the limit, per cent.
             */
            mean_extent_percent: number;
        };
        /** @description One of the models of which the best was kept. */
        Start: {
            /**
             * Format: double
             * @description Mean distance to the surface, two-sided, mm.
             */
            distance_mean_mm: number;
            /**
             * Format: double
             * @description Largest distance to the surface, two-sided, mm.
             */
            hausdorff_mm: number;
            /**
             * Format: double
             * @description Mean 2r/R of its triangles.
             */
            radius_ratio_mean: number;
            /**
             * Format: int64
             * @description Its seed.
             */
            seed: number;
        };
        /** @description Whose scan a volume is, as a caller states it. */
        StatedScan: {
            /** @description Accession Number. */
            accession_number?: string | null;
            /** @description Frame of Reference UID. */
            frame_of_reference_uid?: string | null;
            /** @description Patient's Birth Date, `YYYYMMDD`. */
            patient_birth_date?: string | null;
            /**
             * @description Patient ID; needed for a file that is not DICOM.
             * @example 4711
             */
            patient_id?: string | null;
            /**
             * @description Patient's Name, components separated by `^`.
             * @example Doe^Jane
             */
            patient_name?: string | null;
            /** @description Patient's Sex: M, F or O. */
            patient_sex?: string | null;
            /** @description Referring Physician's Name, components separated by `^`. */
            referring_physician?: string | null;
            /** @description Study Date, `YYYYMMDD`. */
            study_date?: string | null;
            /** @description Study ID. */
            study_id?: string | null;
            /**
             * @description Study Instance UID; needed for a file that is not DICOM.
             * @example 1.2.840.99999.1.1
             */
            study_uid?: string | null;
        };
        /** @description Mean, spread and percentiles of a list of numbers. All zero for an empty list. */
        Summary: {
            /**
             * Format: double
             * @description Standard deviation over the mean.
             */
            cv: number;
            /**
             * Format: double
             * @description Largest.
             */
            max: number;
            /**
             * Format: double
             * @description Arithmetic mean.
             */
            mean: number;
            /**
             * Format: double
             * @description 50th percentile.
             */
            median: number;
            /**
             * Format: double
             * @description Smallest.
             */
            min: number;
            /**
             * Format: double
             * @description 5th percentile.
             */
            p5: number;
            /**
             * Format: double
             * @description 95th percentile.
             */
            p95: number;
            /**
             * Format: double
             * @description Root of the mean square.
             */
            rms: number;
        };
        /** @description The noise of a scan where its surface lies. */
        SurfaceNoise: {
            /**
             * Format: double
             * @description Full width at half maximum of the noise's correlation between places, mm; 0 without noise.
             */
            correlation_mm: number;
            /**
             * Format: double
             * @description Standard deviation of the intensities, in the volume's units.
             */
            intensity: number;
            /**
             * Format: double
             * @description Root mean square of the distances by which the vertices were moved, mm.
             */
            moved_mm: number;
            /**
             * Format: double
             * @description Standard deviation of the surface's place, mm: that of the intensities over the steepness
             *     of the image across the surface, the median over all vertices.
             */
            offset_mm: number;
        };
        /** @description Figures of the iso-surface. */
        SurfaceReport: {
            /**
             * Format: double
             * @description Area, mm².
             */
            area_mm2: number;
            /**
             * Format: int64
             * @description Enclosed cavities before they were filled.
             */
            cavities_before: number;
            /**
             * Format: int64
             * @description Connected components.
             */
            components: number;
            /**
             * Format: int64
             * @description Components before all but one were removed.
             */
            components_before: number;
            /**
             * Format: int64
             * @description V - E + F.
             */
            euler_characteristic: number;
            /**
             * Format: int64
             * @description Handles over all components.
             */
            genus: number;
            /**
             * Format: int64
             * @description Handles before they were removed.
             */
            handles_before: number;
            /** @description Smallest and largest intensity. */
            intensity_range: number[];
            /**
             * Format: double
             * @description The iso-value as a share of the reference intensity.
             */
            iso_fraction: number;
            /**
             * Format: double
             * @description The iso-value, in the volume's units.
             */
            iso_value: number;
            /** @description `intensity`, `mask` or `labels`. */
            kind: string;
            /**
             * Format: int64
             * @description The object's label.
             */
            label?: number | null;
            /**
             * Format: double
             * @description Volume of the voxels that carry the label, millilitres, which the surface is made to enclose;
             *     null for intensities.
             */
            mask_ml?: number | null;
            /**
             * Format: double
             * @description Area of that cut, mm².
             */
            neighbour_cut_mm2: number;
            /**
             * Format: int64
             * @description Voxels of neighbouring organs that were cut off.
             */
            neighbour_voxels_cut: number;
            noise?: components["schemas"]["SurfaceNoise"] | null;
            /**
             * Format: int64
             * @description Voxels that are NaN or infinite.
             */
            not_finite_voxels: number;
            /**
             * Format: double
             * @description Otsu's threshold.
             */
            otsu?: number | null;
            /**
             * Format: int64
             * @description Components that face outward; the others bound cavities.
             */
            outward_components: number;
            /**
             * Format: double
             * @description The object's maximum, which percentages refer to.
             */
            reference_intensity: number;
            /**
             * Format: double
             * @description Volume of the object's voxels, millilitres.
             */
            region_ml: number;
            /** @description Whether the object touches the volume's border. */
            touches_border: boolean;
            /**
             * Format: int64
             * @description Number of triangles.
             */
            triangles: number;
            /**
             * Format: double
             * @description How much the object looks like a left ventricle.
             */
            ventricle_score?: number | null;
            /**
             * Format: int64
             * @description Number of vertices.
             */
            vertices: number;
            /**
             * Format: double
             * @description Enclosed volume, millilitres.
             */
            volume_ml: number;
            /**
             * Format: double
             * @description Smallest voxel spacing, mm.
             */
            voxel_mm: number;
            /**
             * Format: int64
             * @description Voxels cut to open handles.
             */
            voxels_cut: number;
            /**
             * Format: int64
             * @description Voxels of dropped components.
             */
            voxels_dropped: number;
            /**
             * Format: int64
             * @description Voxels filled to close handles and cavities.
             */
            voxels_filled: number;
        };
        TagsPatch: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string | null;
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string | null;
            } | null;
        };
        /** @description A template: a model that jobs name, or that every `model=auto` fits. */
        Template: {
            /**
             * Format: date-time
             * @description When it was added (RFC 3339).
             */
            created_at: string;
            /** @description Its files. */
            files: components["schemas"]["Download"][];
            /**
             * @description Derived from tenant, organ and mesh, so it is the same on every machine.
             * @example tpl_2c26b46b68ffc68ff99b453c1d304134
             */
            id: string;
            /** @description Whether every `model=auto` fits it. Otherwise only jobs that name it do. */
            library: boolean;
            /** @description Related paths. */
            links: components["schemas"]["TemplateLinks"];
            /** @description Its name. */
            name: string;
            /**
             * @description The organ it shows.
             * @example left_ventricle
             */
            organ: string;
            /** @description The program that added it. */
            software: components["schemas"]["Software"];
            /** @description Counts and main figures. */
            summary: components["schemas"]["TemplateSummary"];
        };
        /** @enum {string} */
        TemplateFileName: "mesh.glb" | "mesh.gltf" | "mesh.stl" | "mesh.ply" | "mesh.obj" | "mesh.vtp" | "mesh.vtk" | "mesh.json";
        /** @description Paths of one template. */
        TemplateLinks: {
            /** @description Its mesh, in the format that `Accept` asks for. */
            mesh: string;
            /** @description This template. */
            self: string;
        };
        /** @description A page of templates. */
        TemplateList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The templates, newest first. */
            templates: components["schemas"]["Template"][];
        };
        /** @description A JSON merge patch of a template's setting. */
        TemplatePatch: {
            /** @description Whether every `model=auto` fits the template */
            library?: boolean | null;
        };
        /** @description The main figures of a template. */
        TemplateSummary: {
            /**
             * Format: double
             * @description Length of its cup, mm; ventricles only.
             */
            length_mm?: number | null;
            /**
             * Format: int64
             * @description Number of triangles.
             */
            triangles: number;
            /**
             * Format: int64
             * @description Number of vertices.
             */
            vertices: number;
            /**
             * Format: double
             * @description Enclosed volume, millilitres.
             */
            volume_ml: number;
            /** @description Assumptions about the mesh and changes of it, in sentences. */
            warnings: string[];
        };
        /** @description The wall that an artery usually feeds. */
        Territory: {
            /**
             * Format: double
             * @description Area of its muscle, mm².
             */
            area_mm2: number;
            /**
             * Format: double
             * @description Share of its area below the threshold.
             */
            extent_percent: number;
            /**
             * Format: double
             * @description Mean uptake in per cent of the reference.
             */
            mean_percent?: number | null;
            /** @description LAD, LCX or RCA. */
            name: string;
        };
        /** @description The wall of an artery beside its limits. */
        TerritoryScore: {
            /**
             * Format: double
             * @description Mean score of its wall, per cent of the greatest.
             */
            deficit_percent: number;
            /**
             * Format: double
             * @description Share of its wall below the limit.
             */
            extent_percent: number;
            /** @description LAD, LCX or RCA. */
            name: string;
            /**
             * Format: int32
             * @description Sum of its segments' scores.
             */
            summed_score: number;
        };
        /** @description Thickness of a wall, mm. */
        Thickness: {
            /**
             * Format: double
             * @description Its mean.
             */
            mean: number;
            /**
             * Format: double
             * @description Its standard deviation over the wall.
             */
            spread: number;
        };
        /** @description Thickness of both walls, mm. */
        Thicknesses: {
            /** @description Of the wall corrected for the blur. */
            anatomical: components["schemas"]["Thickness"];
            /** @description Of nine of ten hearts that look so, the true mean thickness lies within these. */
            anatomical_interval?: number[] | null;
            /** @description Of the wall as the blurred image shows it. */
            apparent: components["schemas"]["Thickness"];
        };
        /** @description What the file says of the beats. */
        TimingReport: {
            /**
             * Format: double
             * @description Beats accepted.
             */
            beats_accepted?: number | null;
            /**
             * Format: double
             * @description Beats rejected.
             */
            beats_rejected?: number | null;
            /**
             * Format: double
             * @description Length of a gate.
             */
            frame_time_ms?: number | null;
            /**
             * Format: double
             * @description The longest R-R interval accepted.
             */
            high_rr_ms?: number | null;
            /**
             * Format: double
             * @description The shortest R-R interval accepted.
             */
            low_rr_ms?: number | null;
            /**
             * Format: double
             * @description The R-R interval.
             */
            nominal_interval_ms?: number | null;
        };
        /** @description Standard deviation of the nodes' distance from the walls, millimetres. */
        Uncertainties: {
            /** @description From the wall itself. */
            anatomical: components["schemas"]["Uncertainty"];
            /** @description From the wall as it looks. */
            apparent: components["schemas"]["Uncertainty"];
        };
        /** @description Standard deviation of the nodes' distance from a wall, millimetres. */
        Uncertainty: {
            /**
             * Format: double
             * @description The greatest.
             */
            greatest: number;
            /**
             * Format: double
             * @description Median over the nodes.
             */
            median: number;
            /**
             * Format: double
             * @description 95th percentile over the nodes.
             */
            percentile_95: number;
        };
        /** @description What a fit gave before views were shifted back. */
        UncorrectedReport: {
            /**
             * Format: double
             * @description Volume of the cavity, ml.
             */
            cavity_ml?: number | null;
            /**
             * Format: double
             * @description Confidence.
             */
            confidence: number;
            /** @description What each segment gained by the correction, points. */
            segments_change: (number | null)[];
            /** @description Uptake of the 17 segments, % of the reference. */
            segments_percent: (number | null)[];
            /**
             * Format: double
             * @description Volume of the wall, ml.
             */
            wall_ml: number;
        };
        UploadForm: {
            /**
             * Format: binary
             * @description The volume; several files make up one: a .hdr/.img pair, a DICOM series (a slice or a gate in each file), or 6 to 32 NIfTI files of one gate each, in the order of the numbers in their names or else of the form
             */
            file: string;
        };
        /** @description Uptake of a part of the wall at stress and at rest, means over its area. */
        UptakeChange: {
            /**
             * Format: double
             * @description Rest less stress, points: positive where stress lacks uptake.
             */
            difference_points?: number | null;
            /**
             * Format: double
             * @description Share of its compared area that is fixed.
             */
            fixed_percent: number;
            /**
             * Format: double
             * @description At rest.
             */
            rest_percent?: number | null;
            /**
             * Format: double
             * @description Share of its compared area that is reversible.
             */
            reversible_percent: number;
            /**
             * Format: double
             * @description At stress, scaled to rest; `null` where nothing can be compared, as for the others.
             */
            stress_percent?: number | null;
        };
        /** @description Numbers of edges that meet at a vertex. */
        Valence: {
            /** @description Number of vertices for each valence. */
            counts: {
                [key: string]: number;
            };
            /**
             * Format: double
             * @description Share of vertices with five, six or seven.
             */
            share_5_to_7: number;
            /**
             * Format: double
             * @description Share of vertices with six edges, the regular case.
             */
            share_6: number;
        };
        /**
         * @description What may be said of a change.
         * @enum {string}
         */
        Verdict: "yes" | "no" | "cannot_tell";
        /** @description One view. */
        ViewReport: {
            /**
             * Format: double
             * @description How far towards higher columns of the detector, mm.
             */
            across_mm?: number | null;
            /**
             * Format: double
             * @description How far towards the head the heart lay from its mean place, mm, as measured in this view alone.
             */
            along_mm?: number | null;
            /**
             * Format: double
             * @description Angle of the detector about the patient, degrees: 0 at the back, 90 at the left side.
             */
            angle_deg: number;
            /**
             * Format: double
             * @description Counts.
             */
            counts: number;
            /**
             * Format: double
             * @description The second by the moves that are told, mm.
             */
            moved_across_mm?: number | null;
            /**
             * Format: double
             * @description The first by the moves that are told, mm.
             */
            moved_along_mm?: number | null;
            /**
             * Format: int64
             * @description Number in time, from 1; views of several detectors at one time have the same.
             */
            time: number;
        };
        /** @description A stored volume: what its header says. */
        Volume: {
            /** @description Maps a voxel index to millimetres in the patient frame LPS; row by row. */
            affine: number[][];
            /**
             * @description The part of the header that gave the affine.
             * @example sform
             */
            affine_source: string;
            /**
             * Format: int64
             * @description Size of all its files in bytes.
             */
            bytes: number;
            /** @description Whether it was gzipped. */
            compressed: boolean;
            /**
             * Format: date-time
             * @description When it was stored (RFC 3339).
             */
            created_at: string;
            dicom?: components["schemas"]["Scan"] | null;
            /**
             * @description Data type in the file.
             * @example int16
             */
            dtype: string;
            /**
             * Format: date-time
             * @description When it will be erased unless it is uploaded or used again (RFC 3339); absent if it is kept.
             */
            expires_at?: string | null;
            /** @description The caller's own id for it; not shown to the scope `read`. */
            external_id?: string | null;
            /**
             * Format: int64
             * @description Number of its files.
             */
            files: number;
            /**
             * @description File format.
             * @example NIfTI-1
             */
            format: string;
            /**
             * @description The frame of `affine`.
             * @example LPS
             */
            frame: string;
            /**
             * Format: int64
             * @description How many volumes of that shape the file holds; if several, the parameter `frame` chooses
             *     one.
             */
            frames: number;
            gates?: components["schemas"]["Gates"] | null;
            /**
             * @description Derived from the SHA-256 of the content, so it is the same on every machine.
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            id: string;
            /** @description The voxel values after slope and intercept. */
            intensity: components["schemas"]["Intensity"];
            /** @description The voxel values in rising order if the volume looks like a label map. */
            label_values?: number[] | null;
            /** @description The caller's own names and values for it; none are shown to the scope `read`. */
            labels: {
                [key: string]: string;
            };
            legal_hold?: components["schemas"]["LegalHold"] | null;
            /** @description Related paths. */
            links: components["schemas"]["VolumeLinks"];
            /** @description Its files as they were uploaded. */
            originals: components["schemas"]["VolumeFile"][];
            /** @description Voxels along i, j, k of one frame. */
            shape: number[];
            /** @description Voxel spacing along the first three axes, millimetres. */
            spacing_mm: number[];
            /** @description Oddities of the file that do not prevent its use. */
            warnings: string[];
        };
        /** @description An uploaded file. */
        VolumeFile: {
            /**
             * Format: int64
             * @description Its length in bytes.
             */
            bytes: number;
            /** @description Its path. */
            href: string;
            /** @description Its media type. */
            media_type: string;
            /**
             * @description Its name in the store; not that of the upload.
             * @example volume.nii.gz
             */
            name: string;
            /** @description SHA-256 of its content, hexadecimal; also its `ETag`. */
            sha256: string;
        };
        /** @description Least and greatest volumes of one wall, millilitres. */
        VolumeIntervals: {
            /** @description Of the cavity. */
            cavity: number[];
            /** @description Of the wall. */
            wall: number[];
        };
        VolumeJobRequest: {
            /**
             * @description The id in the caller's own system
             * @example A-2026-17
             */
            external_id?: string;
            /**
             * @description The kind of work
             * @default model
             * @enum {string}
             */
            kind?: "model" | "segmentation" | "beat" | "comparison" | "serial" | "normals";
            /**
             * @description The caller's own names and values
             * @example {
             *       "study": "42"
             *     }
             */
            labels?: {
                [key: string]: string;
            };
            parameters?: components["schemas"]["JobParameters"];
            /**
             * @description How urgent the job is: every waiting job of a higher priority starts before it
             * @default routine
             * @enum {string}
             */
            priority?: "urgent" | "routine" | "bulk";
            /** @description DICOM objects of the result that are sent to an archive */
            send?: ("mask.dcm" | "contours.dcm" | "mesh.dcm" | "surface.dcm" | "measurements.dcm" | "polar.dcm" | "page.dcm" | "mask_ed.dcm" | "mask_es.dcm" | "polar_stress.dcm" | "polar_rest.dcm" | "polar_difference.dcm")[];
            /** @description The archive that they are sent to; that of `source` unless given */
            to?: string;
            /**
             * @description Id of the volume
             * @example vol_9f86d081884c7d659a2feaa0c55ad015
             */
            volume: string;
            webhook?: components["schemas"]["WebhookRequest"];
        };
        /** @description Paths of one volume. */
        VolumeLinks: {
            /** @description The uploaded file; absent if there are several. */
            content?: string | null;
            /** @description Its legal hold: PUT sets it, DELETE lifts it. */
            hold: string;
            /** @description Whose scan it is: PUT states it, DELETE erases it. */
            identity: string;
            /** @description Three middle slices as PNG. */
            preview: string;
            /** @description This volume. */
            self: string;
        };
        /** @description A page of volumes. */
        VolumeList: {
            /** @description `cursor` of the next page; absent on the last. */
            next_cursor?: string | null;
            /** @description The volumes, newest first. */
            volumes: components["schemas"]["Volume"][];
        };
        /**
         * @description A figure of the wall.
         * @enum {string}
         */
        WallFigure: "motion" | "thickening" | "phase" | "difference" | "z" | "score";
        /** @description Volumes of one wall, millilitres. */
        WallVolumes: {
            /**
             * Format: double
             * @description Of the cavity.
             */
            cavity: number;
            /**
             * Format: double
             * @description Of the wall.
             */
            wall: number;
        };
        /** @description A registered receiver. */
        Webhook: {
            /**
             * Format: date-time
             * @description When it was registered (RFC 3339).
             */
            created_at: string;
            /** @description The events that it is told. */
            events: string[];
            /**
             * Format: date-time
             * @description Since when it answers 410 and is told nothing (RFC 3339).
             */
            gone_at?: string | null;
            /**
             * @description Its id.
             * @example whk_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f
             */
            id: string;
            /** @description What signs its deliveries; shown only when it is registered. */
            secret?: string | null;
            /**
             * @description Where it is.
             * @example https://ris.example.org/hooks/ventriform
             */
            url: string;
        };
        /** @description The registered receivers. */
        WebhookList: {
            /** @description The oldest first. */
            webhooks: components["schemas"]["Webhook"][];
        };
        /** @description A receiver to be told about jobs. */
        WebhookRequest: {
            /** @description What to tell; the three ends of a job unless given */
            events?: components["schemas"]["HookEvent"][];
            /**
             * @description What signs the deliveries (Standard Webhooks): `whsec_` and base64. Made by the service unless given, and never
             *     shown again
             * @example whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw
             */
            secret?: string;
            /**
             * Format: uri
             * @description Where to send deliveries: https, and a public host unless the operator allows it
             * @example https://ris.example.org/hooks/ventriform
             */
            url: string;
        };
        /** @description A signing secret. */
        WebhookSecret: {
            /**
             * Format: date-time
             * @description Until when the secret before signs too (RFC 3339).
             */
            former_until: string;
            /**
             * @description `whsec_` and base64, as the libraries of Standard Webhooks take it.
             * @example whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw
             */
            secret: string;
        };
        /**
         * @description One of the two scans.
         * @enum {string}
         */
        WhichScan: "stress" | "rest";
    };
    responses: never;
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type Agreement = components['schemas']['Agreement'];
export type AppliedReader = components['schemas']['AppliedReader'];
export type AuditEventName = components['schemas']['AuditEventName'];
export type AuditPage = components['schemas']['AuditPage'];
export type Beat = components['schemas']['Beat'];
export type BeatChange = components['schemas']['BeatChange'];
export type BeatFileName = components['schemas']['BeatFileName'];
export type BeatJobRequest = components['schemas']['BeatJobRequest'];
export type BeatLinks = components['schemas']['BeatLinks'];
export type BeatList = components['schemas']['BeatList'];
export type BeatParameters = components['schemas']['BeatParameters'];
export type BeatReport = components['schemas']['BeatReport'];
export type BeatSummary = components['schemas']['BeatSummary'];
export type Candidate = components['schemas']['Candidate'];
export type Closeness = components['schemas']['Closeness'];
export type CohortCase = components['schemas']['CohortCase'];
export type CohortRequest = components['schemas']['CohortRequest'];
export type ComparedScan = components['schemas']['ComparedScan'];
export type ComparedSegment = components['schemas']['ComparedSegment'];
export type ComparedTerritory = components['schemas']['ComparedTerritory'];
export type Comparison = components['schemas']['Comparison'];
export type ComparisonFileName = components['schemas']['ComparisonFileName'];
export type ComparisonForm = components['schemas']['ComparisonForm'];
export type ComparisonJobRequest = components['schemas']['ComparisonJobRequest'];
export type ComparisonLinks = components['schemas']['ComparisonLinks'];
export type ComparisonList = components['schemas']['ComparisonList'];
export type ComparisonParameters = components['schemas']['ComparisonParameters'];
export type ComparisonReport = components['schemas']['ComparisonReport'];
export type ComparisonRequest = components['schemas']['ComparisonRequest'];
export type ComparisonSummary = components['schemas']['ComparisonSummary'];
export type CurvePoint = components['schemas']['CurvePoint'];
export type Delivery = components['schemas']['Delivery'];
export type DeliveryList = components['schemas']['DeliveryList'];
export type Dependency = components['schemas']['Dependency'];
export type DicomJson = components['schemas']['DicomJson'];
export type Distance = components['schemas']['Distance'];
export type DistanceDirection = components['schemas']['DistanceDirection'];
export type Download = components['schemas']['Download'];
export type ErasedFile = components['schemas']['ErasedFile'];
export type ErasedItem = components['schemas']['ErasedItem'];
export type ErasurePlan = components['schemas']['ErasurePlan'];
export type ErasureReason = components['schemas']['ErasureReason'];
export type Evidence = components['schemas']['Evidence'];
export type ExcludedCase = components['schemas']['ExcludedCase'];
export type FhirBundle = components['schemas']['FhirBundle'];
export type FigureBeside = components['schemas']['FigureBeside'];
export type FigureChange = components['schemas']['FigureChange'];
export type FigureSegment = components['schemas']['FigureSegment'];
export type FileFacts = components['schemas']['FileFacts'];
export type Fit = components['schemas']['Fit'];
export type FitnessFormStages = components['schemas']['FitnessFormStages'];
export type FitnessForms = components['schemas']['FitnessForms'];
export type FitnessReport = components['schemas']['FitnessReport'];
export type FitnessScales = components['schemas']['FitnessScales'];
export type FitnessTermStages = components['schemas']['FitnessTermStages'];
export type FitnessTerms = components['schemas']['FitnessTerms'];
export type FittedVolumes = components['schemas']['FittedVolumes'];
export type Flag = components['schemas']['Flag'];
export type GateReport = components['schemas']['GateReport'];
export type Gates = components['schemas']['Gates'];
export type GlobalLimit = components['schemas']['GlobalLimit'];
export type GroupSex = components['schemas']['GroupSex'];
export type Health = components['schemas']['Health'];
export type Histogram = components['schemas']['Histogram'];
export type Histograms = components['schemas']['Histograms'];
export type HoldRequest = components['schemas']['HoldRequest'];
export type HookEvent = components['schemas']['HookEvent'];
export type Intensity = components['schemas']['Intensity'];
export type IntensityFacts = components['schemas']['IntensityFacts'];
export type Job = components['schemas']['Job'];
export type JobLinks = components['schemas']['JobLinks'];
export type JobList = components['schemas']['JobList'];
export type JobParameters = components['schemas']['JobParameters'];
export type JobRequest = components['schemas']['JobRequest'];
export type JobSource = components['schemas']['JobSource'];
export type JobState = components['schemas']['JobState'];
export type Key = components['schemas']['Key'];
export type KeyList = components['schemas']['KeyList'];
export type KeyState = components['schemas']['KeyState'];
export type LabelCount = components['schemas']['LabelCount'];
export type LearntLevel = components['schemas']['LearntLevel'];
export type LearntOffset = components['schemas']['LearntOffset'];
export type LearntOffsets = components['schemas']['LearntOffsets'];
export type LearntOn = components['schemas']['LearntOn'];
export type LeftOut = components['schemas']['LeftOut'];
export type LegalHold = components['schemas']['LegalHold'];
export type LimitMap = components['schemas']['LimitMap'];
export type Localisation = components['schemas']['Localisation'];
export type LongAxis = components['schemas']['LongAxis'];
export type MeshDocument = components['schemas']['MeshDocument'];
export type MeshFacts = components['schemas']['MeshFacts'];
export type Model = components['schemas']['Model'];
export type ModelFileName = components['schemas']['ModelFileName'];
export type ModelJobRequest = components['schemas']['ModelJobRequest'];
export type ModelLinks = components['schemas']['ModelLinks'];
export type ModelList = components['schemas']['ModelList'];
export type ModelParameters = components['schemas']['ModelParameters'];
export type ModelReport = components['schemas']['ModelReport'];
export type ModelSummary = components['schemas']['ModelSummary'];
export type MoveReport = components['schemas']['MoveReport'];
export type NewKey = components['schemas']['NewKey'];
export type NoBeat = components['schemas']['NoBeat'];
export type NoBeatCode = components['schemas']['NoBeatCode'];
export type NormalCase = components['schemas']['NormalCase'];
export type NormalGroup = components['schemas']['NormalGroup'];
export type NormalGroupSummary = components['schemas']['NormalGroupSummary'];
export type NormalLimits = components['schemas']['NormalLimits'];
export type Normals = components['schemas']['Normals'];
export type NormalsFileName = components['schemas']['NormalsFileName'];
export type NormalsFitParameters = components['schemas']['NormalsFitParameters'];
export type NormalsJobRequest = components['schemas']['NormalsJobRequest'];
export type NormalsLinks = components['schemas']['NormalsLinks'];
export type NormalsList = components['schemas']['NormalsList'];
export type NormalsParameters = components['schemas']['NormalsParameters'];
export type NormalsRequest = components['schemas']['NormalsRequest'];
export type NormalsSummary = components['schemas']['NormalsSummary'];
export type NormalsUsed = components['schemas']['NormalsUsed'];
export type NotReady = components['schemas']['NotReady'];
export type ObjectDelivery = components['schemas']['ObjectDelivery'];
export type OptimiseReport = components['schemas']['OptimiseReport'];
export type Perfusion = components['schemas']['Perfusion'];
export type PhaseReport = components['schemas']['PhaseReport'];
export type PlaceState = components['schemas']['PlaceState'];
export type PlannedItem = components['schemas']['PlannedItem'];
export type PolarAttenuation = components['schemas']['PolarAttenuation'];
export type PolarFigure = components['schemas']['PolarFigure'];
export type PolarMap = components['schemas']['PolarMap'];
export type PolarSegment = components['schemas']['PolarSegment'];
export type PolarSummary = components['schemas']['PolarSummary'];
export type Posture = components['schemas']['Posture'];
export type Priority = components['schemas']['Priority'];
export type Problem = components['schemas']['Problem'];
export type ProjectionsReport = components['schemas']['ProjectionsReport'];
export type RatesReport = components['schemas']['RatesReport'];
export type ReadKind = components['schemas']['ReadKind'];
export type ReadScores = components['schemas']['ReadScores'];
export type Reader = components['schemas']['Reader'];
export type ReaderFileName = components['schemas']['ReaderFileName'];
export type ReaderLinks = components['schemas']['ReaderLinks'];
export type ReaderList = components['schemas']['ReaderList'];
export type ReaderOffsets = components['schemas']['ReaderOffsets'];
export type ReaderProfile = components['schemas']['ReaderProfile'];
export type ReaderSummary = components['schemas']['ReaderSummary'];
export type Reading = components['schemas']['Reading'];
export type ReadingFileName = components['schemas']['ReadingFileName'];
export type ReadingLinks = components['schemas']['ReadingLinks'];
export type ReadingList = components['schemas']['ReadingList'];
export type ReadingParameters = components['schemas']['ReadingParameters'];
export type ReadingReport = components['schemas']['ReadingReport'];
export type ReadingRequest = components['schemas']['ReadingRequest'];
export type ReadingSummary = components['schemas']['ReadingSummary'];
export type Ready = components['schemas']['Ready'];
export type Receipt = components['schemas']['Receipt'];
export type ReceiptLinks = components['schemas']['ReceiptLinks'];
export type ReceiptList = components['schemas']['ReceiptList'];
export type Received = components['schemas']['Received'];
export type ReceivedLinks = components['schemas']['ReceivedLinks'];
export type ReceivedList = components['schemas']['ReceivedList'];
export type ReceivedState = components['schemas']['ReceivedState'];
export type Receiving = components['schemas']['Receiving'];
export type Redelivered = components['schemas']['Redelivered'];
export type RefusedTemplate = components['schemas']['RefusedTemplate'];
export type Resolution = components['schemas']['Resolution'];
export type RetileReport = components['schemas']['RetileReport'];
export type RevokedKeys = components['schemas']['RevokedKeys'];
export type Scaling = components['schemas']['Scaling'];
export type Scan = components['schemas']['Scan'];
export type ScanUids = components['schemas']['ScanUids'];
export type Scope = components['schemas']['Scope'];
export type SegmentMotionReport = components['schemas']['SegmentMotionReport'];
export type SegmentScore = components['schemas']['SegmentScore'];
export type Segmentation = components['schemas']['Segmentation'];
export type SegmentationFileName = components['schemas']['SegmentationFileName'];
export type SegmentationForm = components['schemas']['SegmentationForm'];
export type SegmentationJobRequest = components['schemas']['SegmentationJobRequest'];
export type SegmentationLinks = components['schemas']['SegmentationLinks'];
export type SegmentationList = components['schemas']['SegmentationList'];
export type SegmentationParameters = components['schemas']['SegmentationParameters'];
export type SegmentationReport = components['schemas']['SegmentationReport'];
export type SegmentationSummary = components['schemas']['SegmentationSummary'];
export type Serial = components['schemas']['Serial'];
export type SerialFileName = components['schemas']['SerialFileName'];
export type SerialJobRequest = components['schemas']['SerialJobRequest'];
export type SerialLinks = components['schemas']['SerialLinks'];
export type SerialList = components['schemas']['SerialList'];
export type SerialPair = components['schemas']['SerialPair'];
export type SerialParameters = components['schemas']['SerialParameters'];
export type SerialReport = components['schemas']['SerialReport'];
export type SerialRequest = components['schemas']['SerialRequest'];
export type SerialScan = components['schemas']['SerialScan'];
export type SerialSegment = components['schemas']['SerialSegment'];
export type SerialSummary = components['schemas']['SerialSummary'];
export type Sex = components['schemas']['Sex'];
export type Shape = components['schemas']['Shape'];
export type Smoothness = components['schemas']['Smoothness'];
export type Software = components['schemas']['Software'];
export type SourceJobRequest = components['schemas']['SourceJobRequest'];
export type SourceRequest = components['schemas']['SourceRequest'];
export type Specificity = components['schemas']['Specificity'];
export type Start = components['schemas']['Start'];
export type StatedScan = components['schemas']['StatedScan'];
export type Summary = components['schemas']['Summary'];
export type SurfaceNoise = components['schemas']['SurfaceNoise'];
export type SurfaceReport = components['schemas']['SurfaceReport'];
export type TagsPatch = components['schemas']['TagsPatch'];
export type Template = components['schemas']['Template'];
export type TemplateFileName = components['schemas']['TemplateFileName'];
export type TemplateLinks = components['schemas']['TemplateLinks'];
export type TemplateList = components['schemas']['TemplateList'];
export type TemplatePatch = components['schemas']['TemplatePatch'];
export type TemplateSummary = components['schemas']['TemplateSummary'];
export type Territory = components['schemas']['Territory'];
export type TerritoryScore = components['schemas']['TerritoryScore'];
export type Thickness = components['schemas']['Thickness'];
export type Thicknesses = components['schemas']['Thicknesses'];
export type TimingReport = components['schemas']['TimingReport'];
export type Uncertainties = components['schemas']['Uncertainties'];
export type Uncertainty = components['schemas']['Uncertainty'];
export type UncorrectedReport = components['schemas']['UncorrectedReport'];
export type UploadForm = components['schemas']['UploadForm'];
export type UptakeChange = components['schemas']['UptakeChange'];
export type Valence = components['schemas']['Valence'];
export type Verdict = components['schemas']['Verdict'];
export type ViewReport = components['schemas']['ViewReport'];
export type Volume = components['schemas']['Volume'];
export type VolumeFile = components['schemas']['VolumeFile'];
export type VolumeIntervals = components['schemas']['VolumeIntervals'];
export type VolumeJobRequest = components['schemas']['VolumeJobRequest'];
export type VolumeLinks = components['schemas']['VolumeLinks'];
export type VolumeList = components['schemas']['VolumeList'];
export type WallFigure = components['schemas']['WallFigure'];
export type WallVolumes = components['schemas']['WallVolumes'];
export type Webhook = components['schemas']['Webhook'];
export type WebhookList = components['schemas']['WebhookList'];
export type WebhookRequest = components['schemas']['WebhookRequest'];
export type WebhookSecret = components['schemas']['WebhookSecret'];
export type WhichScan = components['schemas']['WhichScan'];
export type $defs = Record<string, never>;
export type operations = Record<string, never>;
