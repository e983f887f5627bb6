"""The messages of a file as a viewer reads them: from the schemas in it alone."""

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader


def declared_class(data, name):
    """Return the class of a message from the FileDescriptorSet of a schema record."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def messages(path, *topics):
    """Return topic, log time and message of a recording's messages, in the order of the file."""
    classes, found = {}, []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(
            topics or None, log_time_order=False
        ):
            if schema.id not in classes:
                classes[schema.id] = declared_class(schema.data, schema.name)
            found.append(
                (channel.topic, message.log_time, classes[schema.id].FromString(message.data))
            )
    return found


def records(path):
    """Return all records of a file, in its order."""
    with path.open("rb") as file:
        return list(StreamReader(file, validate_crcs=True).records)
