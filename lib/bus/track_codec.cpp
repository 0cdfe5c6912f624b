#include "bus/track_codec.h"

#include <cmath>

namespace roadfix {

namespace {

bool measures(const TrackSighting& s) {
  const bool left = s.left.allFinite() && std::isfinite(s.sigma_px) && s.sigma_px > 0.0;
  const bool right = !s.right || (s.right->allFinite() && std::isfinite(s.right_sigma_px) && s.right_sigma_px > 0.0);
  return left && right && std::isfinite(s.walk_px) && s.walk_px >= 0.0;
}

}  // namespace

TrackPicture track_picture(const vo_features2_t& m) {
  TrackPicture picture;
  picture.t_us = m.utime;
  picture.tracks.reserve(m.track_id.size());
  for (size_t i = 0; i < m.track_id.size(); ++i) {
    TrackSighting s;
    s.track = m.track_id[i];
    s.left = Eigen::Vector2f(m.u_px[i], m.v_px[i]).cast<double>();
    s.sigma_px = static_cast<double>(m.sigma_px[i]);
    s.walk_px = static_cast<double>(m.walk_px[i]);
    if (m.right[i] == vo_features2_t::RIGHT_SEEN) {
      s.right = Eigen::Vector2f(m.right_u_px[i], m.right_v_px[i]).cast<double>();
      s.right_sigma_px = static_cast<double>(m.right_sigma_px[i]);
    }
    const bool ascends = picture.tracks.empty() || picture.tracks.back().track < s.track;
    if (ascends && measures(s)) picture.tracks.push_back(s);
  }
  return picture;
}

void append(const TrackSighting& s, int8_t use, vo_features2_t& m) {
  m.track_id.push_back(s.track);
  m.u_px.push_back(static_cast<float>(s.left.x()));
  m.v_px.push_back(static_cast<float>(s.left.y()));
  m.sigma_px.push_back(static_cast<float>(s.sigma_px));
  m.walk_px.push_back(static_cast<float>(s.walk_px));
  const Eigen::Vector2d right = s.right.value_or(Eigen::Vector2d::Zero());
  m.right.push_back(s.right ? vo_features2_t::RIGHT_SEEN : vo_features2_t::RIGHT_NONE);
  m.right_u_px.push_back(static_cast<float>(right.x()));
  m.right_v_px.push_back(static_cast<float>(right.y()));
  m.right_sigma_px.push_back(static_cast<float>(s.right ? s.right_sigma_px : 0.0));
  m.use.push_back(use);
  m.num_features = static_cast<int32_t>(m.track_id.size());
}

}  // namespace roadfix
