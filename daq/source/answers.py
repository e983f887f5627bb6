"""How long a gRPC device server may take to answer, and the numbers that it really sends.

The client's library sets no limit, and only copies the numbers.
"""

from typing import Any

import grpc


class Answers(grpc.UnaryUnaryClientInterceptor):
    """Limits every call, and counts the numbers in each answer to a read.

    An interceptor of the channel.

    Args:
        limit: Longest wait for an answer, s: a hung server raises an error. It is an argument of
            each call, because gRPC ends those limited by a service configuration at once after
            the computer's date was set back.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self.numbers = 0
        """Numbers in the last answer to a read; 0 if it was an error without them."""
        self.said = 0
        """Samples of each channel that this answer says were read."""
        self.beyond: int | None = None
        """A count in it that 16 bits do not hold: the client's library would wrap it."""

    def intercept_unary_unary(
        self, continuation: Any, client_call_details: Any, request: Any
    ) -> Any:
        call = continuation(client_call_details._replace(timeout=self._limit), request)
        if not hasattr(request, "array_size_in_samps"):
            return call
        self.numbers, self.said, self.beyond = 0, 0, None
        if call.exception() is None:
            answer = call.result()
            self.numbers, self.said = len(answer.read_array), answer.samps_per_chan_read
            if self.numbers and type(answer).__name__ == "ReadBinaryI16Response":
                ends = min(answer.read_array), max(answer.read_array)
                self.beyond = next((c for c in ends if not -(2**15) <= c < 2**15), None)
        return call
