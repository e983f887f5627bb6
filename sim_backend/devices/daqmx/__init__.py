"""An NI-DAQmx device behind gRPC, as the unmodified nidaqmx client sees it."""
