"""A cell and its frames: found by name, measured, labelled and solved."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from workbench.cell.data_sheet import DataSheet, data_sheet_text
    from workbench.cell.extracting import Extracted, extract_inputs
    from workbench.cell.inputs import BareImages, read_inputs
    from workbench.cell.labels import label_alone, label_dataset, poses_in_sensor
    from workbench.cell.locating import located
    from workbench.cell.measuring import (
        MeasuredProfile,
        Value,
        judged,
        measure,
        peak_values,
        profile_values,
        value_objects,
    )
    from workbench.cell.on_surface import field_of_view_of
    from workbench.cell.pipeline import Observed, ProfileSettings, Progress, observe, solve
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
    from workbench.cell.profiling import ProfileSource, is_profile_file, read_profile, usable, with_options
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
        why_no_stripe,
    )
    from workbench.cell.surroundings import (
        SeesAll,
        around_jig,
        jig_bodies,
        sees_all_strings,
        target_bodies,
        wall_behind,
    )
    from workbench.cell.verifying import scp_of, verify_cell

__all__ = [
    "DESIGN_SCP",
    "PLACES",
    "BareImages",
    "DataSheet",
    "Extracted",
    "FramePose",
    "MeasuredProfile",
    "MeasuredStripe",
    "Observed",
    "ProfileSettings",
    "ProfileSource",
    "Progress",
    "SeesAll",
    "StripeInputs",
    "Value",
    "around_jig",
    "data_sheet_text",
    "dataset_config",
    "extract_inputs",
    "field_of_view_of",
    "find_emulator",
    "find_jig",
    "find_robot",
    "find_sensor",
    "find_target",
    "flag_counts",
    "frame_poses",
    "is_profile_file",
    "jig_bodies",
    "judged",
    "label_alone",
    "label_dataset",
    "located",
    "measure",
    "measure_stripes",
    "observe",
    "peak_values",
    "place_of_jig",
    "poses_in_sensor",
    "preset_path",
    "profile_values",
    "read_inputs",
    "read_profile",
    "rows",
    "scp_of",
    "sees_all_strings",
    "solve",
    "stripe_images",
    "stripe_overlay",
    "stripe_record",
    "target_bodies",
    "usable",
    "value_objects",
    "verify_cell",
    "wall_behind",
    "why_no_stripe",
    "with_known_grain",
    "with_options",
    "write_starter",
]

# every command uses some of them; those of the surroundings load the emulator's kernels
__getattr__ = lazy_names(
    __name__,
    {
        "workbench.cell.data_sheet": (
            "DataSheet",
            "data_sheet_text",
        ),
        "workbench.cell.extracting": (
            "Extracted",
            "extract_inputs",
        ),
        "workbench.cell.inputs": (
            "BareImages",
            "read_inputs",
        ),
        "workbench.cell.labels": (
            "label_alone",
            "label_dataset",
            "poses_in_sensor",
        ),
        "workbench.cell.locating": ("located",),
        "workbench.cell.measuring": (
            "MeasuredProfile",
            "Value",
            "judged",
            "measure",
            "peak_values",
            "profile_values",
            "value_objects",
        ),
        "workbench.cell.on_surface": ("field_of_view_of",),
        "workbench.cell.pipeline": (
            "Observed",
            "ProfileSettings",
            "Progress",
            "observe",
            "solve",
        ),
        "workbench.cell.points_table": ("rows",),
        "workbench.cell.posing": (
            "FramePose",
            "frame_poses",
        ),
        "workbench.cell.presets": (
            "DESIGN_SCP",
            "find_emulator",
            "find_jig",
            "find_robot",
            "find_sensor",
            "find_target",
            "preset_path",
        ),
        "workbench.cell.profiling": (
            "ProfileSource",
            "is_profile_file",
            "read_profile",
            "usable",
            "with_options",
        ),
        "workbench.cell.speckle": (
            "dataset_config",
            "with_known_grain",
        ),
        "workbench.cell.starter": (
            "PLACES",
            "place_of_jig",
            "write_starter",
        ),
        "workbench.cell.stripes": (
            "MeasuredStripe",
            "StripeInputs",
            "flag_counts",
            "measure_stripes",
            "stripe_images",
            "stripe_overlay",
            "stripe_record",
            "why_no_stripe",
        ),
        "workbench.cell.verifying": (
            "scp_of",
            "verify_cell",
        ),
        "workbench.cell.surroundings": (
            "SeesAll",
            "around_jig",
            "jig_bodies",
            "sees_all_strings",
            "target_bodies",
            "wall_behind",
        ),
    },
)
