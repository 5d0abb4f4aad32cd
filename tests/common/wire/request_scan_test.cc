// SPDX-License-Identifier: Apache-2.0
#include "common/wire/request_scan.h"

#include <gmock/gmock.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/wire_format_lite.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <string>

#include "rigcal/v1/agent_service.pb.h"
#include "rigcal/v1/calibration_service.pb.h"
#include "rigcal/v1/camera_service.pb.h"
#include "rigcal/v1/identity_service.pb.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "rigcal/v1/lens_service.pb.h"
#include "rigcal/v1/live_service.pb.h"
#include "rigcal/v1/maintenance_service.pb.h"
#include "rigcal/v1/replication_service.pb.h"
#include "rigcal/v1/rig_service.pb.h"
#include "rigcal/v1/session_service.pb.h"
#include "rigcal/v1/status_service.pb.h"
#include "rigcal/v1/triangulation_service.pb.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::wire::request_scan_test {
namespace {

using ::google::protobuf::Descriptor;
using ::google::protobuf::FieldDescriptor;
using ::google::protobuf::Message;
using ::google::protobuf::Reflection;
using ::google::protobuf::internal::WireFormatLite;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

absl::Status Scan(const Descriptor& type, const std::string& bytes) {
  google::protobuf::io::ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()));
  return ScanRequest(type, &stream);
}
absl::Status Scan(const Message& message) {
  return Scan(*message.GetDescriptor(), message.SerializeAsString());
}

// Every message that a request is or has.
std::set<const Descriptor*> RequestTypes() {
  std::set<const Descriptor*> types;
  const std::function<void(const Descriptor*)> add = [&](const Descriptor* type) {
    if (!types.insert(type).second) return;
    for (int i = 0; i < type->field_count(); ++i) {
      if (type->field(i)->message_type() != nullptr) add(type->field(i)->message_type());
    }
  };
  for (const auto* file :
       {v1::ListAgentsRequest::descriptor()->file(),
        v1::GetCalibrationRequest::descriptor()->file(),
        v1::GetPreviewRequest::descriptor()->file(), v1::CreateTokenRequest::descriptor()->file(),
        v1::ConnectRequest::descriptor()->file(), v1::GetLiveRequest::descriptor()->file(),
        v1::CompactRequest::descriptor()->file(), v1::GetSessionRequest::descriptor()->file(),
        v1::GetStatusRequest::descriptor()->file(), v1::GetRigRequest::descriptor()->file(),
        v1::TriangulateRequest::descriptor()->file(), v1::GetLensRequest::descriptor()->file(),
        v1::ListChangesRequest::descriptor()->file()}) {
    EXPECT_EQ(file->service_count(), 1) << file->name();
    for (int i = 0; i < file->service(0)->method_count(); ++i) {
      const Descriptor* const request = file->service(0)->method(i)->input_type();
      EXPECT_TRUE(IsRequest(*request)) << request->full_name();
      EXPECT_FALSE(IsRequest(*file->service(0)->method(i)->output_type()));
      add(request);
    }
  }
  return types;
}

bool NeedsLimit(const FieldDescriptor& field) {
  return field.is_repeated() || field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
}

const FieldLimit* Find(const std::string& name) {
  for (const FieldLimit& limit : FieldLimits()) {
    if (name == limit.field) return &limit;
  }
  return nullptr;
}

TEST(RequestLimits, EveryFieldOfEveryRequestThatCanGrowHasOne) {
  std::set<std::string> seen;
  for (const Descriptor* type : RequestTypes()) {
    for (int i = 0; i < type->field_count(); ++i) {
      const FieldDescriptor& field = *type->field(i);
      EXPECT_FALSE(field.is_map()) << field.full_name();
      if (!NeedsLimit(field)) continue;
      seen.insert(field.full_name());
      const FieldLimit* const limit = Find(field.full_name());
      ASSERT_NE(limit, nullptr) << "add " << field.full_name() << " to request_limits.cc";
      EXPECT_EQ(limit->count > 0, field.is_repeated()) << field.full_name();
      EXPECT_EQ(limit->bytes > 0, field.cpp_type() == FieldDescriptor::CPPTYPE_STRING)
          << field.full_name();
    }
  }
  for (const FieldLimit& limit : FieldLimits()) {
    EXPECT_TRUE(seen.contains(limit.field)) << limit.field << " is no field of a request";
  }
  EXPECT_EQ(seen.size(), FieldLimits().size()) << "a field is listed twice";
}

// Puts `count` elements into a repeated field.
void Fill(Message* message, const FieldDescriptor* field, uint32_t count) {
  const Reflection& reflection = *message->GetReflection();
  for (uint32_t i = 0; i < count; ++i) {
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        reflection.AddMessage(message, field);
        break;
      case FieldDescriptor::CPPTYPE_STRING:
        reflection.AddString(message, field, "a");
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        reflection.AddEnumValue(message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        reflection.AddDouble(message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_FLOAT:
        reflection.AddFloat(message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        reflection.AddUInt32(message, field, 300);  // of two bytes
        break;
      case FieldDescriptor::CPPTYPE_INT32:
        reflection.AddInt32(message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        reflection.AddInt64(message, field, 1);
        break;
      default:
        FAIL() << field->full_name();
    }
  }
}

TEST(ScanRequest, TakesEveryFieldAtItsLimitAndNoMore) {
  for (const Descriptor* type : RequestTypes()) {
    for (int i = 0; i < type->field_count(); ++i) {
      const FieldDescriptor* const field = type->field(i);
      const FieldLimit* const limit = Find(field->full_name());
      if (limit == nullptr) continue;
      const std::unique_ptr<Message> message(
          google::protobuf::MessageFactory::generated_factory()->GetPrototype(type)->New());
      const Reflection& reflection = *message->GetReflection();
      if (field->is_repeated()) {
        Fill(message.get(), field, limit->count);
        EXPECT_THAT(Scan(*message), IsOk()) << field->full_name();
        Fill(message.get(), field, 1);
        EXPECT_THAT(Scan(*message), StatusIs(absl::StatusCode::kInvalidArgument,
                                             HasSubstr(field->name() + ": has more than ")));
      }
      if (limit->bytes == 0) continue;
      message->Clear();
      const auto set = [&](uint32_t bytes) {
        if (field->is_repeated()) {
          message->Clear();
          reflection.AddString(message.get(), field, std::string(bytes, 'a'));
        } else {
          reflection.SetString(message.get(), field, std::string(bytes, 'a'));
        }
      };
      set(limit->bytes);
      EXPECT_THAT(Scan(*message), IsOk()) << field->full_name();
      set(limit->bytes + 1);
      EXPECT_THAT(Scan(*message), StatusIs(absl::StatusCode::kInvalidArgument,
                                           HasSubstr(field->name() + ": has ")));
    }
  }
}

TEST(ScanRequest, NamesThePath) {
  v1::ConnectRequest request;
  for (int i = 0; i < 3; ++i) request.mutable_hello()->add_cameras();
  request.mutable_hello()->mutable_cameras(2)->mutable_description()->mutable_clock()->set_clock_id(
      std::string(1000, 'c'));
  EXPECT_THAT(Scan(request),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("hello.cameras[2].description.clock.clock_id: has 1000 bytes")));
}

TEST(ScanRequest, CountsNumbersThatAreNotPackedToo) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream out(&stream);
    for (int i = 0; i < 100'000; ++i) {
      WireFormatLite::WriteUInt32(v1::ObservationBatch::kVisibleMaskFieldNumber, 1, &out);
    }
  }
  EXPECT_THAT(Scan(*v1::ObservationBatch::descriptor(), bytes),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("visible_mask: has more")));
}

TEST(ScanRequest, PartsThatEachPassDoNotPassTogether) {
  v1::UploadBatchRequest part;
  for (int i = 0; i < 3000; ++i) part.mutable_batch()->add_clock_samples();
  const std::string bytes = part.SerializeAsString();
  EXPECT_THAT(Scan(*part.GetDescriptor(), bytes), IsOk());
  EXPECT_THAT(Scan(*part.GetDescriptor(), bytes + bytes),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("batch: comes twice")));
}

TEST(ScanRequest, TakesSomeFieldsOfANewerRelease) {
  std::string bytes;
  google::protobuf::UnknownFieldSet unknown;
  for (int i = 0; i < 64; ++i) unknown.AddVarint(1000 + i, 7);
  ASSERT_TRUE(unknown.SerializeToString(&bytes));
  EXPECT_THAT(Scan(*v1::GetSessionRequest::descriptor(), bytes), IsOk());
  unknown.AddLengthDelimited(2000, "text");
  ASSERT_TRUE(unknown.SerializeToString(&bytes));
  EXPECT_THAT(Scan(*v1::GetSessionRequest::descriptor(), bytes),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not know")));
}

TEST(ScanRequest, RefusesBytesThatAreNoMessageWhereverTheyAreCut) {
  v1::UploadBatchRequest request;
  request.mutable_batch()->set_session_id("wave");
  for (int i = 0; i < 20; ++i) {
    request.mutable_batch()->add_time_ns(i);
    request.mutable_batch()->add_visible_mask(1000);
    request.mutable_batch()->add_clock_samples()->set_device_ns(i);
  }
  const std::string bytes = request.SerializeAsString();
  int refused = 0;
  for (size_t size = 0; size < bytes.size(); ++size) {
    const bool parses = v1::UploadBatchRequest().ParseFromString(bytes.substr(0, size));
    const bool passes = Scan(*request.GetDescriptor(), bytes.substr(0, size)).ok();
    EXPECT_TRUE(passes || !parses) << size;
    refused += passes ? 0 : 1;
  }
  EXPECT_GT(refused, 100);
  EXPECT_THAT(Scan(*request.GetDescriptor(), std::string(50, '\xff')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no message")));
}

}  // namespace
}  // namespace rigcal::wire::request_scan_test
