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

    def intercept_unary_unary(
        self, continuation: Any, client_call_details: Any, request: Any
    ) -> Any:
        if not hasattr(request, "array_size_in_samps"):
            return continuation(client_call_details, request)
        self.numbers = self.said = 0
        call = continuation(client_call_details, request)
        if call.exception() is None:
            answer = call.result()
            self.numbers, self.said = len(answer.read_array), answer.samps_per_chan_read
        return call
