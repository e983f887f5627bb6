"""The numbers that a gRPC device server really sends: the client's library only copies them."""

from typing import Any

import grpc


class Answers(grpc.UnaryUnaryClientInterceptor):
    """Counts the numbers in each answer to a read, as an interceptor of the channel."""

    def __init__(self) -> None:
        self.numbers = 0
        """Numbers in the last answer to a read; 0 if it was an error without them."""
        self.said = 0
        """Samples of each channel that this answer says were read."""
        self.beyond: int | None = None
        """A count in it that 16 bits do not hold: the client's library would wrap it."""

    def intercept_unary_unary(
        self, continuation: Any, client_call_details: Any, request: Any
    ) -> Any:
        if not hasattr(request, "array_size_in_samps"):
            return continuation(client_call_details, request)
        self.numbers, self.said, self.beyond = 0, 0, None
        call = continuation(client_call_details, request)
        if call.exception() is None:
            answer = call.result()
            self.numbers, self.said = len(answer.read_array), answer.samps_per_chan_read
            if self.numbers and type(answer).__name__ == "ReadBinaryI16Response":
                ends = min(answer.read_array), max(answer.read_array)
                self.beyond = next((c for c in ends if not -(2**15) <= c < 2**15), None)
        return call
