"""The terminal at which a device receives the trigger's edge."""

from typing import Any

from sautereau.rig.acquisition import Daq


def trigger_terminal(daq: Daq, options: Any) -> str:
    """Return the trigger's terminal with its device: ``/Dev1/PFI0``.

    A module of a CompactDAQ chassis has no trigger terminals of its own; those of its chassis are
    meant. A complete name, which starts with a slash, is returned unchanged.

    Args:
        daq: The rig's table of the acquisition.
        options: Of the gRPC session; None for the driver of this machine.
    """
    from nidaqmx.constants import ProductCategory
    from nidaqmx.system import Device

    if daq.trigger_source.startswith("/"):
        return daq.trigger_source
    device = Device(daq.device, grpc_options=options)
    owner = daq.device
    if device.product_category == ProductCategory.C_SERIES_MODULE:
        owner = device.compact_daq_chassis_device.name
    return f"/{owner}/{daq.trigger_source}"
