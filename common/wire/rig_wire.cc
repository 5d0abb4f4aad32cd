// SPDX-License-Identifier: Apache-2.0
#include "common/wire/rig_wire.h"

#include "common/wire/time_wire.h"

namespace rigcal::wire {

v1::Activation ToProto(const Activation& activation) {
  v1::Activation proto;
  proto.set_rig(activation.rig);
  proto.set_number(activation.number);
  proto.set_calibration_id(activation.calibration_id);
  proto.set_version(activation.version);
  proto.set_previous_calibration_id(activation.previous_calibration_id);
  if (activation.utc_ns != 0) *proto.mutable_time() = ToTimestamp(activation.utc_ns);
  proto.set_operator_name(activation.operator_name);
  proto.set_reason(activation.reason);
  proto.set_forced(activation.forced);
  proto.set_rollback(activation.rollback);
  return proto;
}

Activation FromProto(const v1::Activation& proto) {
  Activation activation;
  activation.rig = proto.rig();
  activation.number = proto.number();
  activation.calibration_id = proto.calibration_id();
  activation.version = proto.version();
  activation.previous_calibration_id = proto.previous_calibration_id();
  activation.utc_ns = FromTimestamp(proto.time());
  activation.operator_name = proto.operator_name();
  activation.reason = proto.reason();
  activation.forced = proto.forced();
  activation.rollback = proto.rollback();
  return activation;
}

std::string SerializeActivation(const Activation& activation) {
  // No maps: the bytes follow from the values.
  return ToProto(activation).SerializeAsString();
}

absl::StatusOr<Activation> ParseActivation(std::string_view bytes) {
  v1::Activation proto;
  if (!proto.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::DataLossError("a stored activation cannot be read: its bytes are damaged");
  }
  return FromProto(proto);
}

}  // namespace rigcal::wire
