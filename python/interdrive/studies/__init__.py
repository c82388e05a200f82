"""Case studies: one encounter of two vehicles at increasing levels of interaction.

Kaufeld, Trauth, Betz, "Investigating Driving Interactions", IV 2024, section IV: merging and a T-junction.
"""

from interdrive.studies.case import case_study
from interdrive.studies.figures import profile_figure, scene_figure
from interdrive.studies.folder import STUDY_FOLDER, save_study
from interdrive.studies.known import STUDIES, Case, known_cases
from interdrive.studies.measures import MEASURES, Measure, footprint_distances
from interdrive.studies.reading import reading
from interdrive.studies.result import DEGREES, CaseStudy, study_table

__all__ = [
    "DEGREES",
    "MEASURES",
    "STUDIES",
    "STUDY_FOLDER",
    "Case",
    "CaseStudy",
    "Measure",
    "case_study",
    "footprint_distances",
    "known_cases",
    "profile_figure",
    "reading",
    "save_study",
    "scene_figure",
    "study_table",
]
