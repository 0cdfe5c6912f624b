package roadfix.spy;

import java.awt.Color;
import java.awt.Graphics2D;
import java.awt.image.BufferedImage;
import java.awt.image.DataBufferByte;
import java.io.ByteArrayInputStream;
import java.io.IOException;
import java.util.Map;
import java.util.TreeMap;
import javax.imageio.ImageIO;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.lcm.LCM;
import lcm.lcm.LCMDataInputStream;
import lcm.lcm.LCMSubscriber;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import roadfix.image_t;
import roadfix.vo_features2_t;

/** A camera's pictures with the tracks of VO_FEATURES that were seen in them. */
public class PicturePlugin implements SpyPlugin {
    private static final String TRACKS = "VO_FEATURES";
    /** Where scripts/spy says which bus lcm-spy listens to: a plugin is not told. */
    private static final String URL = "roadfix.lcm_url";

    @Override
    public boolean canHandle(long fingerprint) {
        return fingerprint == image_t.LCM_FINGERPRINT;
    }

    @Override
    public Action getAction(JDesktopPane desktop, ChannelData channel) {
        return View.action("Picture with tracks", desktop, channel, () -> new Picture(channel));
    }

    private static final class Picture extends View implements LCMSubscriber {
        private static final int KEPT = 40;

        private final TreeMap<Long, image_t> pictures = new TreeMap<>();
        private final TreeMap<Long, vo_features2_t> tracks = new TreeMap<>();
        private final boolean right;
        private long shown = Long.MIN_VALUE;
        private BufferedImage image;
        private String trouble = "no picture yet";
        private LCM lcm;

        Picture(ChannelData channel) {
            super(channel, 660, 260);
            right = channel.name.endsWith("_RIGHT");
            try {
                String url = System.getProperty(URL);
                lcm = url == null ? new LCM() : new LCM(url);
                lcm.subscribe(TRACKS, this);
            } catch (IOException e) {
                trouble = TRACKS + ": " + e.getMessage();
            }
        }

        @Override
        void stop() {
            if (lcm != null) {
                lcm.close();
            }
        }

        @Override
        public void messageReceived(LCM bus, String channel, LCMDataInputStream in) {
            try {
                vo_features2_t message = new vo_features2_t(in);
                synchronized (tracks) {
                    keep(tracks, message.utime, message);
                }
            } catch (IOException e) {
                // another type on that channel, or a broken message: the picture is shown without tracks
            }
        }

        @Override
        void take(Object message) {
            image_t picture = (image_t) message;
            keep(pictures, picture.utime, picture);
        }

        private static <T> void keep(TreeMap<Long, T> map, long utime, T message) {
            if (!map.isEmpty() && utime < map.lastKey() - 10_000_000) {
                map.clear(); // another drive
            }
            map.put(utime, message);
            while (map.size() > KEPT) {
                map.pollFirstEntry();
            }
        }

        /** The newest picture whose tracks are there, or the newest of all where none are. */
        private Map.Entry<Long, image_t> choice(TreeMap<Long, vo_features2_t> known) {
            for (Map.Entry<Long, image_t> entry : pictures.descendingMap().entrySet()) {
                if (known.containsKey(entry.getKey())) {
                    return entry;
                }
            }
            return pictures.lastEntry();
        }

        @Override
        void draw(Graphics2D g) {
            vo_features2_t seen = null;
            Map.Entry<Long, image_t> picture;
            synchronized (tracks) {
                picture = choice(tracks);
                if (picture != null) {
                    seen = tracks.get(picture.getKey());
                }
            }
            if (picture != null && picture.getKey() != shown) {
                shown = picture.getKey();
                image = decoded(picture.getValue());
            }
            if (image == null) {
                g.drawString(trouble, 10, 20);
                return;
            }
            double scale = Math.min((double) getWidth() / image.getWidth(), (double) getHeight() / image.getHeight());
            g.scale(scale, scale);
            g.drawImage(image, 0, 0, null);
            if (seen != null) {
                drawTracks(g, seen);
            }
        }

        private void drawTracks(Graphics2D g, vo_features2_t seen) {
            for (int i = 0; i < seen.num_features; ++i) {
                if (right && seen.right[i] != vo_features2_t.RIGHT_SEEN) {
                    continue;
                }
                int u = Math.round(right ? seen.right_u_px[i] : seen.u_px[i]);
                int v = Math.round(right ? seen.right_v_px[i] : seen.v_px[i]);
                g.setColor(colourOf(seen.use[i]));
                g.drawOval(u - 3, v - 3, 6, 6);
            }
            g.setColor(Color.YELLOW);
            g.drawString(seen.num_features + " tracks", 8, 16);
        }

        private static Color colourOf(int use) {
            switch (use) {
                case vo_features2_t.USE_INLIER:
                    return Color.GREEN;
                case vo_features2_t.USE_OUTLIER:
                    return Color.RED;
                case vo_features2_t.USE_MATCHED:
                    return Color.CYAN;
                default:
                    return Color.YELLOW;
            }
        }

        private BufferedImage decoded(image_t m) {
            try {
                BufferedImage out = m.format == image_t.FORMAT_GRAY8 ? raw(m, BufferedImage.TYPE_BYTE_GRAY, 1)
                    : m.format == image_t.FORMAT_BGR8 ? raw(m, BufferedImage.TYPE_3BYTE_BGR, 3)
                    : ImageIO.read(new ByteArrayInputStream(m.data));
                if (out == null) {
                    trouble = "a picture that cannot be read";
                }
                return out;
            } catch (IOException e) {
                trouble = "a picture that cannot be read: " + e.getMessage();
                return null;
            }
        }

        private static BufferedImage raw(image_t m, int type, int channels) throws IOException {
            long size = (long) m.width_px * m.height_px * channels;
            if (m.width_px <= 0 || m.height_px <= 0 || size != m.data.length) {
                throw new IOException(m.data.length + " bytes are no " + m.width_px + " x " + m.height_px);
            }
            BufferedImage out = new BufferedImage(m.width_px, m.height_px, type);
            System.arraycopy(m.data, 0, ((DataBufferByte) out.getRaster().getDataBuffer()).getData(), 0, m.data.length);
            return out;
        }
    }
}
