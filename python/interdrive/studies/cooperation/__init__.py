"""What cooperation by V2X changes: share of equipped agents, delay and loss, over scenarios and seeds."""

from interdrive.studies.cooperation.deadlock import deadlocks
from interdrive.studies.cooperation.figure import cooperation_figure
from interdrive.studies.cooperation.folder import COOPERATION_FOLDER, save_cooperation
from interdrive.studies.cooperation.measure import COLUMNS, CooperationStudy, cooperation_study
from interdrive.studies.cooperation.summary import summary_table
from interdrive.studies.cooperation.variants import WITHOUT_ORDERS, Variant, cooperation_files, cooperation_variants

__all__ = [
    "COLUMNS",
    "COOPERATION_FOLDER",
    "WITHOUT_ORDERS",
    "CooperationStudy",
    "Variant",
    "cooperation_figure",
    "cooperation_files",
    "cooperation_study",
    "cooperation_variants",
    "deadlocks",
    "save_cooperation",
    "summary_table",
]
