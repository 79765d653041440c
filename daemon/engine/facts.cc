#include "daemon/engine/facts.h"

namespace lightstage {

RigFacts FactsOf(Rig& rig) {
  const RigFile& file = rig.file();
  Camera& camera = rig.camera();
  RigFacts facts{.camera = camera.info(),
                 .camera_config = file.camera_options.config,
                 .validate_exposure = [&camera](Duration d) { return camera.ValidateExposure(d); },
                 .default_exposures = file.camera_options.exposures,
                 .limits = file.limits,
                 .geometry = file.geometry,
                 .compression = file.store.compression};
  if (const Axis* axis = rig.axis(AxisId::kTurntable)) facts.turntable = axis->info();
  if (const Axis* axis = rig.axis(AxisId::kTilt)) facts.tilt = axis->info();
  if (rig.lamps()) facts.lamps = rig.lamps()->info();
  if (rig.projector()) facts.projector = rig.projector()->info();
  return facts;
}

}  // namespace lightstage
