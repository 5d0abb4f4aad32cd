// SPDX-License-Identifier: Apache-2.0
// Sequences of calls to a server in this process, over a store of its own: valid messages of every
// method, changed field by field by reflection, and plain bytes. Each input begins with a new
// server.
//
// A step is one byte for the method, one for the number of changes (or, from 192 on, for plain
// bytes of that length less 192), and the changes (message_mutation.h). The methods are those of
// the services below in the order of their proto files; a step of IngestService.Connect sends one
// message, of a kind that another byte says, over the stream of one of two agents.
#include <google/protobuf/dynamic_message.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/wire/protocol_version.h"
#include "rigcal/v1/agent_service.pb.h"
#include "rigcal/v1/calibration_service.pb.h"
#include "rigcal/v1/camera_service.pb.h"
#include "rigcal/v1/identity_service.pb.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "rigcal/v1/maintenance_service.pb.h"
#include "rigcal/v1/rig_service.pb.h"
#include "rigcal/v1/session_service.pb.h"
#include "rigcal/v1/status_service.pb.h"
#include "tests/fuzz/fuzz_call.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/fuzz/fuzz_server.h"
#include "tests/fuzz/message_mutation.h"

namespace {

namespace pb = ::google::protobuf;
namespace v1 = ::rigcal::v1;
using ::rigcal::testing::FuzzCall;
using ::rigcal::testing::FuzzInput;

constexpr int kMaxSteps = 24;
constexpr size_t kMaxAnswerBytes = 4u << 20;
constexpr char kConnect[] = "/rigcal.v1.IngestService/Connect";

std::vector<const pb::MethodDescriptor*> Methods() {
  std::vector<const pb::MethodDescriptor*> methods;
  for (const pb::FileDescriptor* file :
       {v1::ConnectRequest::descriptor()->file(), v1::GetSessionRequest::descriptor()->file(),
        v1::GetCalibrationRequest::descriptor()->file(),
        v1::ListAgentsRequest::descriptor()->file(), v1::GetPreviewRequest::descriptor()->file(),
        v1::GetStatusRequest::descriptor()->file(), v1::CompactRequest::descriptor()->file(),
        v1::CreateTokenRequest::descriptor()->file(), v1::GetRigRequest::descriptor()->file()}) {
    const pb::ServiceDescriptor* service = file->service(0);
    for (int i = 0; i < service->method_count(); ++i) methods.push_back(service->method(i));
  }
  return methods;
}

// What is asked most: names that exist, where a message has them.
void FillNames(pb::Message* message) {
  const pb::Descriptor& type = *message->GetDescriptor();
  const auto set = [&](const char* field, const char* value) {
    const pb::FieldDescriptor* found = type.FindFieldByName(field);
    if (found == nullptr || found->cpp_type() != pb::FieldDescriptor::CPPTYPE_STRING) return;
    if (found->is_repeated()) {
      message->GetReflection()->AddString(message, found, value);
    } else {
      message->GetReflection()->SetString(message, found, value);
    }
  };
  const bool of_calibration = type.name().find("Calibration") != std::string::npos ||
                              type.name().find("Accuracy") != std::string::npos;
  set("id", of_calibration ? "c-000001" : "wave");
  set("session_id", "wave");
  set("session_ids", "wave");
  set("camera", "left");
  set("agent_id", "pc1");
}

void FillCamera(const char* name, v1::CameraDescription* camera) {
  camera->set_camera(name);
  camera->mutable_image_size_px()->set_width(1280);
  camera->mutable_image_size_px()->set_height(1024);
  camera->mutable_clock()->set_clock_id(name);
  camera->mutable_clock()->set_timebase("recording");
}

void FillSession(v1::CreateSessionRequest* request) {
  request->mutable_target()->set_kind(v1::Target::KIND_WAND);
  for (const double position : {0.0, 0.13, 0.39}) {
    request->mutable_target()->add_marker_positions_m(position);
  }
  FillCamera("left", request->add_cameras());
}

void FillBatch(const char* camera, uint32_t first_seq, v1::ObservationBatch* batch) {
  FillNames(batch);
  batch->set_camera(camera);
  batch->set_stream_epoch(1);
  batch->set_first_seq(first_seq);
  batch->set_clock_epoch(1);
  batch->set_marker_count(3);
  for (int row = 0; row < 3; ++row) {
    batch->add_time_ns(1'000'000 * (static_cast<int>(first_seq) + row));
    batch->add_visible_mask(7);
    for (int marker = 0; marker < 3; ++marker) {
      batch->add_x_px(100 + static_cast<float>(marker));
      batch->add_y_px(50);
      batch->add_cov_xx_px2(0.01F);
      batch->add_cov_xy_px2(0);
      batch->add_cov_yy_px2(0.01F);
    }
  }
  batch->add_centre_kind(v1::CENTRE_KIND_IMAGE_BLOB);
}

void FillEnd(const char* camera, v1::EndOfCapture* end) {
  FillNames(end);
  end->set_camera(camera);
  end->set_stream_epoch(1);
  end->set_last_seq(6);
}

void FillHello(int agent, v1::AgentHello* hello) {
  *hello->mutable_protocol_version() = rigcal::wire::OwnProtocolVersion();
  hello->set_agent_id(agent == 0 ? "pc1" : "pc2");
  hello->set_incarnation(1);
  hello->set_connection(1);
  hello->set_rig("rig");
  hello->set_installation_secret(agent == 0 ? "1" : "2");
  v1::AnnouncedCamera* camera = hello->add_cameras();
  FillCamera(agent == 0 ? "left" : "right", camera->mutable_description());
  camera->set_stream_epoch(1);
}

// A message as an agent sends it.
v1::ConnectRequest AgentMessage(int agent, uint8_t kind) {
  const char* const camera = agent == 0 ? "left" : "right";
  v1::ConnectRequest message;
  switch (kind % 7) {
    case 0:
      FillHello(agent, message.mutable_hello());
      break;
    case 1:
    case 2:
      FillBatch(camera, kind % 7 == 1 ? 1 : 4, message.mutable_batch());
      break;
    case 3:
      FillEnd(camera, message.mutable_end_of_capture());
      break;
    case 4:
      FillNames(message.mutable_report());
      message.mutable_report()->set_camera(camera);
      message.mutable_report()->set_stream_epoch(1);
      break;
    case 5:
      message.mutable_time_ping();
      break;
    default:
      message.mutable_preview()->mutable_info()->set_camera(camera);
  }
  return message;
}

void Fill(pb::Message* request) {
  FillNames(request);
  if (auto* session = dynamic_cast<v1::CreateSessionRequest*>(request)) FillSession(session);
  if (auto* upload = dynamic_cast<v1::UploadBatchRequest*>(request)) {
    upload->clear_agent_id();
    FillBatch("left", 1, upload->mutable_batch());
  }
}

// What a client may be told. Never UNKNOWN, INTERNAL or DATA_LOSS, and an answer in time.
void CheckStatus(const std::string& method, const FuzzCall& call, const grpc::Status& status) {
  static const std::set<grpc::StatusCode> documented = {grpc::OK,
                                                        grpc::INVALID_ARGUMENT,
                                                        grpc::NOT_FOUND,
                                                        grpc::ALREADY_EXISTS,
                                                        grpc::PERMISSION_DENIED,
                                                        grpc::FAILED_PRECONDITION,
                                                        grpc::RESOURCE_EXHAUSTED,
                                                        grpc::ABORTED,
                                                        grpc::UNAUTHENTICATED};
  for (const std::string& answer : call.answers()) FUZZ_CHECK(answer.size() <= kMaxAnswerBytes);
  if (call.cancelled() && status.error_code() == grpc::CANCELLED) return;
  if (documented.count(status.error_code()) == 1) {
    FUZZ_CHECK(status.ok() || !status.error_message().empty());
    return;
  }
  std::fprintf(stderr, "%s: code %d: %s\n", method.c_str(), status.error_code(),
               status.error_message().c_str());
  std::abort();
}

class Run {
 public:
  Run(const std::filesystem::path& folder, FuzzInput input)
      : server_(folder), stub_(server_.Channel()), input_(input) {}

  void Steps() {
    for (int step = 0; step < kMaxSteps && !input_.empty(); ++step) Step();
    for (int agent = 0; agent < 2; ++agent) EndAgent(agent);
  }
  // After all of it the server has what it has said, and gives it to whoever asks.
  void CheckWhatIsThere() {
    Ask<v1::GetStatusResponse>("StatusService/GetStatus", v1::GetStatusRequest());
    Ask<v1::ListAgentsResponse>("AgentService/ListAgents", v1::ListAgentsRequest());
    const auto calibrations = Ask<v1::ListCalibrationsResponse>(
        "CalibrationService/ListCalibrations", v1::ListCalibrationsRequest());
    for (const v1::Calibration& calibration : calibrations.calibrations()) {
      FUZZ_CHECK(calibration.damage().empty());
    }
    const auto sessions =
        Ask<v1::ListSessionsResponse>("SessionService/ListSessions", v1::ListSessionsRequest());
    for (const v1::Session& session : sessions.sessions()) CheckSession(session);
  }

 private:
  static std::string PathOf(const pb::MethodDescriptor& method) {
    return "/" + method.service()->full_name() + "/" + method.name();
  }

  // Bytes of `message` after the changes that the input says, or others.
  std::string Mutated(pb::Message* message) {
    const uint8_t changes = input_.Byte();
    std::string bytes;
    if (changes >= 192) {
      for (int i = changes - 192; i > 0; --i) bytes.push_back(static_cast<char>(input_.Byte()));
      return bytes;
    }
    for (int i = changes % 6; i > 0; --i) rigcal::testing::MutateMessage(&input_, message, 0);
    message->SerializePartialToString(&bytes);
    return bytes;
  }

  void Step() {
    static const std::vector<const pb::MethodDescriptor*> methods = Methods();
    const uint8_t choice = input_.Byte();
    // Half of the steps are those of agents.
    const pb::MethodDescriptor& method =
        choice < 128 ? *methods[choice % methods.size()] : *methods[0];
    const std::string path = PathOf(method);
    if (path == kConnect) return StepOfAgent(choice & 1);
    const std::unique_ptr<pb::Message> request(
        pb::MessageFactory::generated_factory()->GetPrototype(method.input_type())->New());
    Fill(request.get());
    const bool endless = method.name().find("Watch") == 0;
    FuzzCall call(&stub_, path, endless ? 1 : 100'000);
    call.Send(Mutated(request.get()));
    CheckStatus(path, call, call.Finish());
  }

  void StepOfAgent(int agent) {
    const uint8_t kind = input_.Byte();
    if (kind >= 224) return EndAgent(agent);
    auto& stream = agents_[static_cast<size_t>(agent)];
    if (!stream) stream = std::make_unique<FuzzCall>(&stub_, kConnect, 100'000);
    v1::ConnectRequest message = AgentMessage(agent, kind);
    stream->Send(Mutated(&message));
  }

  void EndAgent(int agent) {
    auto& stream = agents_[static_cast<size_t>(agent)];
    if (!stream) return;
    const grpc::Status status = stream->Finish();
    CheckStatus(kConnect, *stream, status);
    stream.reset();
  }

  template <typename Response, typename Request>
  Response Ask(const std::string& method, const Request& request) {
    FuzzCall call(&stub_, "/rigcal.v1." + method, 100'000);
    call.Send(request.SerializeAsString());
    const grpc::Status status = call.Finish();
    CheckStatus(method, call, status);
    Response response;
    FUZZ_CHECK(status.ok() && call.answers().size() == 1);
    FUZZ_CHECK(response.ParseFromString(call.answers()[0]));
    return response;
  }

  void CheckSession(const v1::Session& summary) {
    FUZZ_CHECK(summary.damage().empty());
    v1::GetSessionRequest request;
    request.set_id(summary.id());
    request.set_audit(true);
    const v1::Session session =
        Ask<v1::GetSessionResponse>("SessionService/GetSession", request).session();
    v1::ReadObservationsRequest read;
    read.set_session_id(summary.id());
    read.set_include_late(true);
    FuzzCall call(&stub_, "/rigcal.v1.SessionService/ReadObservations", 100'000);
    call.Send(read.SerializeAsString());
    FUZZ_CHECK(call.Finish().ok());
    uint64_t rows = 0;
    for (const std::string& answer : call.answers()) {
      v1::ReadObservationsResponse response;
      FUZZ_CHECK(response.ParseFromString(answer));
      rows += static_cast<uint64_t>(response.batch().time_ns_size());
    }
    FUZZ_CHECK(rows == session.observation_count());
  }

  rigcal::testing::FuzzServer server_;
  grpc::GenericStub stub_;
  FuzzInput input_;
  std::array<std::unique_ptr<FuzzCall>, 2> agents_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const rigcal::testing::FuzzFolder folder;
  spdlog::set_level(spdlog::level::off);
  const std::filesystem::path store = folder.path() / "store";
  {
    Run run(store, FuzzInput(data, size));
    run.Steps();
    run.CheckWhatIsThere();
  }
  std::error_code ignored;
  std::filesystem::remove_all(store, ignored);
  return 0;
}
