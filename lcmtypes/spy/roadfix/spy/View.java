package roadfix.spy;

import java.awt.BorderLayout;
import java.awt.Color;
import java.awt.Dimension;
import java.awt.Font;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.RenderingHints;
import java.awt.Window;
import java.awt.event.ActionEvent;
import java.util.function.Supplier;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import javax.swing.JInternalFrame;
import javax.swing.JPanel;
import javax.swing.SwingUtilities;
import javax.swing.Timer;
import lcm.spy.ChannelData;

/** A window of lcm-spy that shows the newest message of one channel. lcm-spy decodes; the view looks at what it decoded. */
abstract class View extends JPanel {
    static final Color GREEN = new Color(0x35a53f);
    static final Color ORANGE = new Color(0xff8000);
    static final Color RED = new Color(0xd22222);
    static final Color PAPER = new Color(0xf4f4f0);
    private static final int PERIOD_MS = 50;

    private final ChannelData channel;
    private Object newest;
    private Timer timer;

    View(ChannelData channel, int width, int height) {
        this.channel = channel;
        setPreferredSize(new Dimension(width, height));
        setBackground(PAPER);
        setFont(new Font(Font.SANS_SERIF, Font.PLAIN, 13));
    }

    /** A new message of the channel; of the type that the plugin handles. */
    abstract void take(Object message);

    abstract void draw(Graphics2D g);

    /** Called when the window is closed. */
    void stop() {}

    @Override
    protected void paintComponent(Graphics g) {
        super.paintComponent(g);
        Graphics2D g2 = (Graphics2D) g.create();
        g2.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
        draw(g2);
        g2.dispose();
    }

    @Override
    public void addNotify() {
        super.addNotify();
        timer = new Timer(PERIOD_MS, event -> look());
        timer.start();
    }

    @Override
    public void removeNotify() {
        timer.stop();
        stop();
        super.removeNotify();
    }

    private void look() {
        Object message = channel.last;
        if (message != null && message != newest) {
            newest = message;
            take(message);
        }
        repaint();
    }

    /** What lcm-spy's menu starts. lcm-spy asks for the name with nulls first. */
    static Action action(String name, JDesktopPane desktop, ChannelData channel, Supplier<View> make) {
        return new AbstractAction(name) {
            @Override
            public void actionPerformed(ActionEvent event) {
                JInternalFrame frame = new JInternalFrame(channel.name + ": " + name, true, true, true);
                frame.setLayout(new BorderLayout());
                frame.add(make.get(), BorderLayout.CENTER);
                frame.setDefaultCloseOperation(JInternalFrame.DISPOSE_ON_CLOSE);
                frame.pack();
                desktop.add(frame);
                frame.setVisible(true);
                Window window = SwingUtilities.getWindowAncestor(desktop);
                if (window != null) {
                    window.setSize(frame.getWidth() + 20, frame.getHeight() + 50);
                }
            }
        };
    }

    static Color colour(int validity) {
        switch (validity) {
            case roadfix.pose_t.VALIDITY_VALID:
                return GREEN;
            case roadfix.pose_t.VALIDITY_COASTING:
                return ORANGE;
            default:
                return RED;
        }
    }
}
