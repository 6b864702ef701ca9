// Prints one message of a topic in hexadecimal: fast_dds_subscriber DOMAIN TOPIC TYPE SECONDS.
//
// A peer of Fast DDS, the default middleware of ROS 2. It takes the serialised bytes as they are.

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

typedef std::vector<unsigned char> Bytes;

// A type whose objects are the serialised messages.
class RawType : public TopicDataType {
public:
    explicit RawType(const std::string &name) {
        setName(name.c_str());
        m_typeSize = 1 << 20;
        m_isGetKeyDefined = false;
    }
    bool serialize(void *, SerializedPayload_t *) override { return false; }
    bool deserialize(SerializedPayload_t *payload, void *data) override {
        static_cast<Bytes *>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void *) override {
        return [] { return 0u; };
    }
    void *createData() override { return new Bytes(); }
    void deleteData(void *data) override { delete static_cast<Bytes *>(data); }
    bool getKey(void *, InstanceHandle_t *, bool) override { return false; }
};

class Listener : public DataReaderListener {
public:
    void on_data_available(DataReader *reader) override {
        Bytes bytes;
        SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::lock_guard<std::mutex> locked(mutex);
            if (message.empty()) message = bytes;
            arrived.notify_one();
        }
    }
    std::mutex mutex;
    std::condition_variable arrived;
    Bytes message;
};

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    DomainParticipantQos qos;
    // Loopback alone, as the test's other side; shared memory would need a common /dev/shm.
    auto transport = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    transport->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(transport);
    Locator_t peer;
    IPLocator::setIPv4(peer, "127.0.0.1");
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);

    DomainParticipant *participant =
        DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), qos);
    if (!participant) return 3;
    TypeSupport type(new RawType(argv[3]));
    type.register_type(participant);
    Topic *topic = participant->create_topic(argv[2], argv[3], TOPIC_QOS_DEFAULT);
    Subscriber *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    DataReaderQos reader_qos = DATAREADER_QOS_DEFAULT;
    reader_qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    reader_qos.history().depth = 5;
    Listener listener;
    if (!subscriber->create_datareader(topic, reader_qos, &listener)) return 4;

    std::unique_lock<std::mutex> locked(listener.mutex);
    bool came = listener.arrived.wait_for(locked, std::chrono::seconds(std::atoi(argv[4])),
                                          [&] { return !listener.message.empty(); });
    for (unsigned char byte : listener.message) std::printf("%02x", byte);
    std::fflush(stdout);
    // The library's threads end with the process.
    std::_Exit(came ? 0 : 1);
}
