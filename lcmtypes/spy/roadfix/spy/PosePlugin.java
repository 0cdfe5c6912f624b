package roadfix.spy;

import java.awt.BasicStroke;
import java.awt.Color;
import java.awt.Graphics2D;
import java.awt.geom.AffineTransform;
import java.awt.geom.Ellipse2D;
import java.awt.geom.Line2D;
import java.awt.geom.Path2D;
import java.util.ArrayDeque;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import roadfix.pose_t;

/** A pose on a small map: where it was, where it points, and the 3-sigma ellipse that it claims. */
public class PosePlugin implements SpyPlugin {
    @Override
    public boolean canHandle(long fingerprint) {
        return fingerprint == pose_t.LCM_FINGERPRINT;
    }

    @Override
    public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return View.action("Map", desktop, channel, () -> new Map(channel));
    }

    private static final class Map extends View {
        private static final int MOST = 4000;
        private static final double SMALLEST_M = 20.0;

        private final ArrayDeque<pose_t> path = new ArrayDeque<>();

        Map(ChannelData channel) {
            super(channel, 480, 480);
        }

        @Override
        void take(Object message) {
            pose_t pose = (pose_t) message;
            pose_t last = path.peekLast();
            if (last != null && (pose.run != last.run || pose.utime < last.utime || pose.reset_counter != last.reset_counter)) {
                path.clear(); // another run, another drive, or a jump
            }
            path.addLast(pose);
            if (path.size() > MOST) {
                path.removeFirst();
            }
        }

        @Override
        void draw(Graphics2D g) {
            pose_t pose = path.peekLast();
            if (pose == null) {
                g.drawString("no pose yet", 10, 20);
                return;
            }
            double reach = SMALLEST_M;
            for (pose_t p : path) {
                reach = Math.max(reach, Math.abs(p.position_m[0] - pose.position_m[0]));
                reach = Math.max(reach, Math.abs(p.position_m[1] - pose.position_m[1]));
            }
            double scale = 0.45 * Math.min(getWidth(), getHeight()) / reach;
            AffineTransform screen = new AffineTransform(scale, 0, 0, -scale, getWidth() / 2.0 - scale * pose.position_m[0],
                getHeight() / 2.0 + scale * pose.position_m[1]);
            drawPath(g, screen);
            if (pose.validity != pose_t.VALIDITY_INVALID) {
                drawHeading(g, pose);
                drawEllipse(g, screen, pose);
            }
            drawScale(g, scale);
            drawWords(g, pose);
        }

        private void drawPath(Graphics2D g, AffineTransform screen) {
            g.setStroke(new BasicStroke(2f));
            pose_t before = null;
            for (pose_t p : path) {
                if (before != null && p.validity != pose_t.VALIDITY_INVALID && before.validity != pose_t.VALIDITY_INVALID) {
                    g.setColor(colour(p.validity));
                    g.draw(screen.createTransformedShape(
                        new Line2D.Double(before.position_m[0], before.position_m[1], p.position_m[0], p.position_m[1])));
                }
                before = p;
            }
        }

        /** Axes of the horizontal covariance in closed form; at least as large as can be seen. */
        private static void drawEllipse(Graphics2D g, AffineTransform screen, pose_t pose) {
            double a = pose.cov_pose_m2_rad2[0][0], b = pose.cov_pose_m2_rad2[0][1], c = pose.cov_pose_m2_rad2[1][1];
            double mean = 0.5 * (a + c), spread = Math.hypot(0.5 * (a - c), b);
            double least = 4.0 / screen.getScaleX();
            double major = Math.max(3.0 * Math.sqrt(Math.max(mean + spread, 0.0)), least);
            double minor = Math.max(3.0 * Math.sqrt(Math.max(mean - spread, 0.0)), least);
            AffineTransform place = new AffineTransform(screen);
            place.translate(pose.position_m[0], pose.position_m[1]);
            place.rotate(0.5 * Math.atan2(2.0 * b, a - c));
            g.setColor(Color.BLUE);
            g.setStroke(new BasicStroke(3f));
            g.draw(place.createTransformedShape(new Ellipse2D.Double(-major, -minor, 2.0 * major, 2.0 * minor)));
        }

        private void drawHeading(Graphics2D g, pose_t pose) {
            double w = pose.q_wxyz[0], x = pose.q_wxyz[1], y = pose.q_wxyz[2], z = pose.q_wxyz[3];
            double yaw = Math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
            AffineTransform place = AffineTransform.getTranslateInstance(getWidth() / 2.0, getHeight() / 2.0);
            place.rotate(-yaw);
            Path2D arrow = new Path2D.Double();
            arrow.moveTo(16, 0);
            arrow.lineTo(-8, 7);
            arrow.lineTo(-4, 0);
            arrow.lineTo(-8, -7);
            arrow.closePath();
            g.setColor(Color.BLACK);
            g.fill(place.createTransformedShape(arrow));
        }

        /** A bar of 1, 2 or 5 times a power of ten. */
        private void drawScale(Graphics2D g, double scale) {
            double wanted = 100.0 / scale, power = Math.pow(10.0, Math.floor(Math.log10(wanted)));
            double length = power * (wanted / power >= 5.0 ? 5 : wanted / power >= 2.0 ? 2 : 1);
            int y = getHeight() - 14;
            g.setColor(Color.DARK_GRAY);
            g.drawLine(12, y, 12 + (int) Math.round(length * scale), y);
            g.drawString(String.format(length < 1.0 ? "%.1f m" : "%.0f m", length), 12, y - 4);
        }

        private static void drawWords(Graphics2D g, pose_t pose) {
            double sigma = Math.sqrt(Math.max(pose.cov_pose_m2_rad2[0][0] + pose.cov_pose_m2_rad2[1][1], 0.0));
            double speed = Math.hypot(pose.velocity_mps[0], pose.velocity_mps[1]);
            String validity = pose.validity == pose_t.VALIDITY_VALID ? "valid" : pose.validity == pose_t.VALIDITY_COASTING ? "coasting" : "invalid";
            g.setColor(colour(pose.validity));
            g.drawString(validity + (pose.reason.isEmpty() ? "" : ": " + pose.reason), 12, 20);
            g.setColor(Color.BLACK);
            g.drawString(String.format("sigma %.2f m, %.1f m/s, %s", sigma, speed, pose.frame == pose_t.FRAME_ENU ? "ENU" : "a frame of its own"), 12, 38);
        }
    }
}
