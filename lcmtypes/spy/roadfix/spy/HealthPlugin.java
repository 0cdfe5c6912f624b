package roadfix.spy;

import java.awt.Color;
import java.awt.Font;
import java.awt.Graphics2D;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import roadfix.health_t;

/** A light for HEALTH: green, orange or red, with the reasons; grey when the monitor is silent. */
public class HealthPlugin implements SpyPlugin {
    private static final long SILENT_US = 2_000_000;

    @Override
    public boolean canHandle(long fingerprint) {
        return fingerprint == health_t.LCM_FINGERPRINT;
    }

    @Override
    public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return View.action("Health light", desktop, channel, () -> new Light(channel));
    }

    private static final class Light extends View {
        private health_t health;
        private long heard_us;

        Light(ChannelData channel) {
            super(channel, 460, 220);
        }

        @Override
        void take(Object message) {
            health = (health_t) message;
            heard_us = System.nanoTime() / 1000;
        }

        @Override
        void draw(Graphics2D g) {
            boolean silent = health == null || System.nanoTime() / 1000 - heard_us > SILENT_US;
            g.setColor(silent ? Color.GRAY : light(health.verdict));
            g.fillOval(20, 20, 120, 120);
            g.setColor(Color.BLACK);
            g.setFont(getFont().deriveFont(Font.BOLD, 20f));
            g.drawString(silent ? "silent" : words(health.verdict), 160, 50);
            g.setFont(getFont());
            if (health == null) {
                return;
            }
            g.drawString(health.pose_channel.isEmpty() ? "no pose was heard" : "of " + health.pose_channel, 160, 72);
            for (int i = 0; i < health.num_reasons; ++i) {
                g.setColor(light(health.reason_verdict[i]));
                g.drawString(health.reason[i], 160, 98 + 18 * i);
            }
        }

        private static Color light(int verdict) {
            return verdict == health_t.VERDICT_OK ? GREEN : verdict == health_t.VERDICT_DEGRADED ? ORANGE : RED;
        }

        private static String words(int verdict) {
            return verdict == health_t.VERDICT_OK ? "OK" : verdict == health_t.VERDICT_DEGRADED ? "degraded" : "DO NOT USE";
        }
    }
}
