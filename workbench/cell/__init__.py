"""A cell and its frames: found by name, measured, labelled and solved."""

from workbench.cell.data_sheet import DataSheet, data_sheet_text
from workbench.cell.extracting import Extracted, extract_inputs
from workbench.cell.inputs import BareImages, read_inputs
from workbench.cell.labels import label_alone, label_dataset, poses_in_sensor
from workbench.cell.locating import located
from workbench.cell.pipeline import Observed, Progress, observe, solve
from workbench.cell.points_table import rows
from workbench.cell.posing import FramePose, frame_poses
from workbench.cell.presets import (
    DESIGN_SCP,
    find_emulator,
    find_jig,
    find_robot,
    find_sensor,
    find_target,
    preset_path,
)
from workbench.cell.profiling import (
    ProfileSource,
    is_profile_file,
    read_profile,
    read_profile_settings,
    with_options,
)
from workbench.cell.speckle import dataset_config, with_known_grain
from workbench.cell.starter import PLACES, place_of_jig, write_starter
from workbench.cell.stripes import (
    MeasuredStripe,
    StripeInputs,
    flag_counts,
    measure_stripes,
    stripe_images,
    stripe_overlay,
    stripe_record,
)
from workbench.cell.surroundings import SeesAll, around_jig, jig_bodies, sees_all_strings, wall_behind
from workbench.cell.verifying import scp_of, verify_cell

__all__ = [
    "DESIGN_SCP",
    "PLACES",
    "BareImages",
    "DataSheet",
    "Extracted",
    "FramePose",
    "MeasuredStripe",
    "Observed",
    "ProfileSource",
    "Progress",
    "SeesAll",
    "StripeInputs",
    "around_jig",
    "data_sheet_text",
    "dataset_config",
    "extract_inputs",
    "find_emulator",
    "find_jig",
    "find_robot",
    "find_sensor",
    "find_target",
    "flag_counts",
    "frame_poses",
    "is_profile_file",
    "jig_bodies",
    "label_alone",
    "label_dataset",
    "located",
    "measure_stripes",
    "observe",
    "place_of_jig",
    "poses_in_sensor",
    "preset_path",
    "read_inputs",
    "read_profile",
    "read_profile_settings",
    "rows",
    "scp_of",
    "sees_all_strings",
    "solve",
    "stripe_images",
    "stripe_overlay",
    "stripe_record",
    "verify_cell",
    "wall_behind",
    "with_known_grain",
    "with_options",
    "write_starter",
]
