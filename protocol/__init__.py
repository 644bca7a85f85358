"""What goes over the wire: policy interface, messages, codec, client and server.

Needs only numpy, msgpack, msgspec and websockets, so that a model's own environment can install it.
`docs/protocol.md` is the specification.
"""
