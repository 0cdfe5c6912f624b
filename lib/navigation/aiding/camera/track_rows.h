/// One track as linear rows: [by the point | by the camera and the views | residual], whitened by what is known of the
/// noise along a track, and the rows that are left without the point, (N.6.2)-(N.6.10). Pure functions.
#pragma once

#include "navigation/aiding/camera/camera_model.h"

namespace roadfix::navigation {

/// Of points that stay in the state.
inline constexpr int kMaxPointColumns = 32;

/// Columns of the errors that rows depend on: the camera's, then each view's (phi, rho), then each point's that stays.
struct TrackColumns {
  static constexpr int kTurn = 0, kPlace = 3, kLens = 6, kRightTurn = 9, kDrift = 12;
  static constexpr int kCamera = 15;
  static constexpr int kMost = kCamera + 6 * kMaxViews + 3 * kMaxPointColumns;
  static constexpr int of_view(int view) { return kCamera + 6 * view; }
  static constexpr int of_point(int views, int point) { return of_view(views) + 3 * point; }
};

/// At most 4 rows a sighting; three columns for the point, one for the residual.
inline constexpr int kMaxTrackRows = 4 * kMaxViews;
inline constexpr int kTrackWidth = 3 + TrackColumns::kMost + 1;

/// Rows of a track: for each sighting u and v of the left eye and, with two eyes, those of the right eye, in pixels.
/// `work` has kMaxTrackRows rows and 3 + columns + 1 columns at least; returns the number of rows written.
int linearise_track(const CameraGeometry& camera, std::span<const ViewPose> views,
                    std::span<const ViewSighting> sightings, int anchor, bool two_eyes, const Eigen::Vector3d& f,
                    Eigen::Ref<Eigen::MatrixXd> work);

/// Makes the noise of these rows white, of unit variance, in place, (N.6.8). The left eye's error of a track is a walk
/// beside white noise; the right eye's place is measured against the left one's.
void whiten_track(std::span<const ViewSighting> sightings, bool two_eyes, Eigen::Ref<Eigen::MatrixXd> work);

/// In-place Householder reflections: the leading `pivots` columns of A become upper triangular, all others turn along,
/// (N.6.10).
void eliminate_columns(Eigen::Ref<Eigen::MatrixXd> A, int pivots);

}  // namespace roadfix::navigation
